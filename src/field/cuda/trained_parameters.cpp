#include "src/field/cuda/trained_parameters.h"

#include "src/field/nets.h"

namespace cnerf {

TrainedNet::TrainedNet(std::vector<float> initial) {
  const std::vector<float> zeros(initial.size(), 0.0f);
  weights_ = {std::move(initial), "nets"};
  first_ = {zeros, "nets"};
  second_ = {zeros, "nets"};
}

void TrainedNet::append_state(const std::string& prefix, std::vector<StatePiece>& state) {
  state.push_back(weights_.fetched(prefix + ".weights"));
  state.push_back(first_.fetched(prefix + ".first_moments"));
  state.push_back(second_.fetched(prefix + ".second_moments"));
}

void TrainedNet::upload() const {
  for (const StateBuffer* buffer : {&weights_, &first_, &second_}) buffer->upload();
}

TrainedGrid::TrainedGrid(const HashGridOptions& options, std::uint64_t seed, const std::string& use)
    : levels_(hash_grid_levels(options)),
      decay_(float(options.decay)),
      table_(initial_table(levels_, seed), use),
      moments_(std::vector<float>(total_rows(levels_) * std::size_t(8), 0.0f), use),
      d_table_(total_rows(levels_), use),
      halves_(total_rows(levels_), use) {}

void TrainedGrid::backward(const LevelRange& range, const float4* places, SampleCount samples, const void* d_encoded,
                           cudaStream_t stream) const {
  const std::vector<GridLevel> some(levels_.begin() + long(range.first), levels_.begin() + long(range.last));
  const uint2* d_some = static_cast<const uint2*>(d_encoded) + range.first * samples.most;
  encode_backward_cuda(some, places, samples, d_some, d_table_.data(), stream);
}

TableRowsCuda TrainedGrid::rows(const LevelRange& range) const {
  const std::uint32_t first = levels_[range.first].first_row;
  const std::uint32_t last = range.last < levels_.size() ? levels_[range.last].first_row : total_rows(levels_);
  const TableRowsCuda all = {reinterpret_cast<float4*>(table_.data()), d_table_.data(),
                             reinterpret_cast<float4*>(moments_.data()), halves_.data(), total_rows(levels_)};
  return all.some(first, last - first);
}

void TrainedGrid::append_state(const std::string& prefix, std::vector<StatePiece>& state) {
  state.push_back(table_.fetched(prefix + ".table"));
  state.push_back(moments_.fetched(prefix + ".moments"));
}

void TrainedGrid::upload(cudaStream_t stream) const {
  table_.upload();
  moments_.upload();
  round_rows(rows(all()), stream);
}

}  // namespace cnerf
