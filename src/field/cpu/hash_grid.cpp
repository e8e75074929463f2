#include "src/field/cpu/hash_grid.h"

#include "src/base/parallel.h"
#include "src/field/nets.h"

namespace cnerf {

HashGridCpu::HashGridCpu(const HashGridOptions& options, std::uint64_t seed)
    : levels_(hash_grid_levels(options)), decay_(float(options.decay)), kernels_(&hash_grid_kernels()) {
  const std::size_t rows = total_rows(levels_);
  const std::vector<float> initial = initial_table(levels_, seed);
  table_.assign(initial.begin(), initial.end());
  d_table_.assign(rows * 4, 0.0f);
  moments_.assign(rows * 8, 0.0f);
}

void HashGridCpu::scatter(std::size_t l, const std::vector<EncodedSamples>& runs) {
  const GridLevel& level = levels_[l];
  for (const EncodedSamples& run : runs) {
    kernels_->scatter_level(level, run.positions, run.d_encoded, run.groups, channels(), 4 * int(l),
                            d_table_.data() + 4 * std::size_t(level.first_row));
  }
}

void HashGridCpu::update(std::size_t l, const AdamStep& step) {
  const GridLevel& level = levels_[l];
  const std::size_t first = level.first_row;
  update_rows({table_.data() + 4 * first, d_table_.data() + 4 * first, moments_.data() + 8 * first, level.rows}, step,
              decay_);
}

void HashGridCpu::backward_and_update(const std::vector<EncodedSamples>& runs, const AdamStep& step,
                                      const GradientSum& sum) {
  // Finest levels first: they take longest.
  const auto each_level = [&](const auto& work) {
    parallel_tasks(levels_.size(), [&](std::size_t task) { work(levels_.size() - 1 - task); });
  };
  if (!sum) {
    return each_level([&](std::size_t l) {
      scatter(l, runs);
      update(l, step);
    });
  }
  each_level([&](std::size_t l) { scatter(l, runs); });
  sum(d_table_);
  each_level([&](std::size_t l) { update(l, step); });
}

void HashGridCpu::append_state(const std::string& prefix, std::vector<StatePiece>& state) {
  state.push_back(state_piece(prefix + ".table", table_));
  state.push_back(state_piece(prefix + ".moments", moments_));
}

}  // namespace cnerf
