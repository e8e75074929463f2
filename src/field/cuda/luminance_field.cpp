#include "src/field/cuda/luminance_field.h"

#include "src/field/nets.h"

namespace cnerf {
namespace {

const char* const kGridAdvice = "the hash grid; lower stage1.grid.log2_rows or stage1.grid.levels";
const char* const kSampleAdvice = "the samples of a step; lower stage1.samples_per_step";

}  // namespace

LuminanceFieldCuda::LuminanceFieldCuda(const HashGridOptions& grid, float density_scale, float max_luminance,
                                       std::uint32_t most_samples, std::uint64_t seed)
    : density_scale_(density_scale),
      activation_(LuminanceActivation<float>::up_to(max_luminance)),
      grid_(grid, seed, kGridAdvice),
      density_(initial_weights(density_net_layout(levels()), seed, kDensityNetStream)),
      luminance_(initial_weights(luminance_net_layout(), seed, kLuminanceNetStream)),
      packed_(field_weight_count(levels())),
      last_layer_(kHiddenWidth, "nets"),
      d_weights_(std::size_t(field_weight_count(levels())) * std::size_t(field_backward_blocks()), "nets"),
      d_encoded_(most_samples * std::size_t(4 * levels()), kSampleAdvice) {}

FieldView LuminanceFieldCuda::view() const {
  FieldView view;
  view.levels = grid_.levels().data();
  view.n_levels = levels();
  view.table = grid_.table();
  view.nets = {packed_.weights(), last_layer_.data()};
  view.density_scale = density_scale_;
  view.activation = activation_;
  return view;
}

void LuminanceFieldCuda::nets_backward(const FieldSamples& samples, cudaStream_t stream) const {
  field_backward({levels(), view().nets, samples, d_encoded_.data(), d_weights_.data()}, stream);
}

void LuminanceFieldCuda::grid_backward(const FieldSamples& samples, cudaStream_t stream) const {
  grid_.backward(samples.places, samples.count, d_encoded_.data(), stream);
}

PositionSlopes LuminanceFieldCuda::position_slopes(int levels) const {
  return {{grid_.levels().begin(), grid_.levels().begin() + levels},
          grid_.table(),
          reinterpret_cast<const uint2*>(d_encoded_.data())};
}

void LuminanceFieldCuda::update_layers_of_nets(const float* d_weights, int parts, const AdamStep* adam,
                                               cudaStream_t stream) const {
  const FieldParameters parameters = {density_.weights(), luminance_.weights(), packed_.weights(), last_layer_.data()};
  update_layers(field_layers(levels(), parameters), d_weights, parts, adam, stream);
}

void LuminanceFieldCuda::update_nets(const AdamStep* adam, cudaStream_t stream) const {
  update_layers_of_nets(d_weights_.data(), field_backward_blocks(), adam, stream);
}

void LuminanceFieldCuda::write_nets_gradient(float* to, cudaStream_t stream) const {
  sum_gradient_parts(d_weights_.data(), field_backward_blocks(), field_weight_count(levels()), to, stream);
}

void LuminanceFieldCuda::update_nets(const float* gradient, const AdamStep* adam, cudaStream_t stream) const {
  update_layers_of_nets(gradient, /*parts=*/1, adam, stream);
}

void LuminanceFieldCuda::append_state(std::vector<StatePiece>& state) {
  grid_.append_state("grid", state);
  density_.append_state("density_net", state);
  luminance_.append_state("luminance_net", state);
}

void LuminanceFieldCuda::upload(cudaStream_t stream) const {
  grid_.upload(stream);
  density_.upload();
  luminance_.upload();
  update_layers_of_nets(nullptr, 0, nullptr, stream);
}

}  // namespace cnerf
