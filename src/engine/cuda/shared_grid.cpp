#include "src/engine/cuda/shared_grid.h"

#include <algorithm>

namespace cnerf {
namespace {

/// From the finest level to the coarsest, in parts of some million rows: exchanges of less are slow for what they are,
/// and of more nothing goes on beside them. Smaller grids have two parts, so that one is exchanged while the other is
/// found.
std::vector<LevelRange> parts_of(const std::vector<GridLevel>& levels) {
  std::uint32_t rows_of_part = 0;
  for (const GridLevel& level : levels) rows_of_part += level.rows;
  rows_of_part = std::min(rows_of_part / 2, 1u << 23);
  std::vector<LevelRange> parts;
  std::uint32_t rows = rows_of_part;
  for (std::size_t l = levels.size(); l-- > 0;) {
    if (rows >= rows_of_part) {
      parts.push_back({l, l + 1});
      rows = 0;
    }
    parts.back().first = l;
    rows += levels[l].rows;
  }
  return parts;
}

template <typename Value>
std::span<std::byte> bytes_of(Value* first, std::size_t count) {
  return std::as_writable_bytes(std::span(first, count));
}

}  // namespace

SharedGrid::SharedGrid(const TrainedGrid& grid, const StepShare& share)
    : grid_(grid), sums_(*share.on_device), piece_(share.part), pieces_(share.parts), parts_(parts_of(grid.levels())) {
  // Levels have rows in eights: 2, 4 and 8 processes get equal pieces. Of other numbers each updates everything.
  const auto divides = [&](const LevelRange& part) { return grid.rows(part).count % std::uint32_t(pieces_) == 0; };
  if (!std::ranges::all_of(parts_, divides)) piece_ = 0, pieces_ = 1;
  if (pieces_ > 1) packed_ = DeviceBuffer<uint2>(grid.rows(grid.all()).count, "what GPUs exchange of the hash grid");
}

uint2* SharedGrid::packed(const LevelRange& part) const {
  return packed_.data() + grid_.levels()[part.first].first_row;
}

TableRowsCuda SharedGrid::own(const LevelRange& part) const {
  const TableRowsCuda rows = grid_.rows(part);
  const std::uint32_t count = rows.count / std::uint32_t(pieces_);
  return rows.some(std::uint32_t(piece_) * count, count);
}

void SharedGrid::pack(const LevelRange& part, cudaStream_t stream) const {
  if (pieces_ > 1) pack_gradient(grid_.rows(part), packed(part), stream);
}

void SharedGrid::sum(const LevelRange& part, cudaStream_t stream) const {
  const TableRowsCuda rows = grid_.rows(part);
  const std::size_t numbers = 4 * std::size_t(rows.count);
  if (pieces_ > 1) {
    sums_.sum_own_piece({reinterpret_cast<Bfloat16*>(packed(part)), numbers}, stream);
  } else {
    sums_.sum(std::span(reinterpret_cast<float*>(rows.gradient), numbers), stream);
  }
}

void SharedGrid::update(const LevelRange& part, const AdamStep* adam, cudaStream_t stream) const {
  const TableRowsCuda rows = grid_.rows(part), own_rows = own(part);
  grid_.update(own_rows, pieces_ > 1 ? packed(part) + (own_rows.values - rows.values) : nullptr, adam, stream);
}

void SharedGrid::hand_round(const LevelRange& part, cudaStream_t stream) const {
  const TableRowsCuda rows = grid_.rows(part);
  if (pieces_ > 1) sums_.hand_round(bytes_of(rows.halves, rows.count), stream);
}

void SharedGrid::complete(cudaStream_t stream) const {
  if (pieces_ == 1) return;
  for (const LevelRange& part : parts_) {
    const TableRowsCuda rows = grid_.rows(part);
    sums_.hand_round(bytes_of(rows.values, rows.count), stream);
    sums_.hand_round(bytes_of(rows.moments, 2 * std::size_t(rows.count)), stream);
  }
}

}  // namespace cnerf
