#include "src/field/cpu/point_net.h"

#include <algorithm>

#include "src/field/nets.h"

namespace cnerf {

PointNetCpu::PointNetCpu(const HashGridOptions& grid, int outputs, bool relu_output, std::uint64_t seed)
    : outputs_(outputs),
      relu_output_(relu_output),
      grid_(grid, seed),
      net_(point_net_layout(int(grid_.levels().size()), outputs), seed, kPointNetStream, relu_output) {}

void PointNetCpu::set_points(std::span<const Vec3f> points, PointWorkspace& work) const {
  work.groups = groups_of(points.size());
  const std::size_t lanes = work.groups * kGroup;
  ensure_size(work.positions, lanes * 3);
  ensure_size(work.encoded, lanes * std::size_t(encoded_channels()));
  for (auto* buffer : {&work.hidden, &work.d_hidden}) ensure_size(*buffer, lanes * kHiddenWidth);
  for (auto* buffer : {&work.output, &work.d_output}) ensure_size(*buffer, lanes * std::size_t(outputs_));
  const GroupedView<float> positions(work.positions, 3);
  for (std::size_t i = 0; i < lanes; ++i) {
    const Vec3f p = i < points.size() ? points[i] : Vec3f{0.5f, 0.5f, 0.5f};
    for (int axis = 0; axis < 3; ++axis) positions.at(i, axis) = std::clamp(p[axis], 0.0f, 1.0f);
  }
}

std::vector<Channels> PointNetCpu::activations(PointWorkspace& work) const {
  return {
      {work.encoded.data(), encoded_channels()}, {work.hidden.data(), kHiddenWidth}, {work.output.data(), outputs_}};
}

void PointNetCpu::forward(PointWorkspace& work) const {
  grid_.encode(work.positions.data(), work.groups, work.encoded.data());
  net_.forward(activations(work), work.groups);
}

void PointNetCpu::backward(PointWorkspace& work, float* d_encoded, float* d_weights) const {
  if (relu_output_) {
    const std::size_t values = work.groups * kGroup * std::size_t(outputs_);
    for (std::size_t i = 0; i < values; ++i) work.d_output[i] = work.output[i] > 0 ? work.d_output[i] : 0;
  }
  net_.backward(
      activations(work),
      {{d_encoded, encoded_channels()}, {work.d_hidden.data(), kHiddenWidth}, {work.d_output.data(), outputs_}},
      work.groups, d_weights);
}

void PointNetCpu::update(const std::vector<EncodedSamples>& runs, const std::vector<float>& d_weights,
                         float learning_rate, long step, const GradientSum& sum) {
  const AdamStep adam(learning_rate, step);
  grid_.backward_and_update(runs, adam, sum);
  net_.update(d_weights, adam);
}

void PointNetCpu::append_state(const std::string& prefix, std::vector<StatePiece>& state) {
  grid_.append_state(prefix + ".grid", state);
  net_.append_state(prefix + ".net", state);
}

}  // namespace cnerf
