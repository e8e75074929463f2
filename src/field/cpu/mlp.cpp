#include "src/field/cpu/mlp.h"

#include <cmath>
#include <utility>

#include "src/base/check.h"

namespace cnerf {

MlpCpu::MlpCpu(MlpLayout layout, std::uint64_t seed, std::uint64_t stream, bool relu_output)
    : layout_(std::move(layout)), relu_output_(relu_output), kernels_(&mlp_kernels()) {
  for (const int width : layout_.widths) CNERF_CHECK(width % 4 == 0, "layer widths are multiples of 4");
  const std::vector<float> initial = initial_weights(layout_, seed, stream);
  weights_.assign(initial.begin(), initial.end());
  first_moments_.assign(weights_.size(), 0.0f);
  second_moments_.assign(weights_.size(), 0.0f);
  transposed_.resize(weights_.size());
  transpose_weights();
}

void MlpCpu::transpose_weights() {
  for (int l = 0; l < layout_.layers(); ++l) {
    const std::size_t offset = layout_.weight_offset(l);
    const int inputs = layout_.widths[l], outputs = layout_.widths[l + 1];
    for (int o = 0; o < outputs; ++o) {
      for (int i = 0; i < inputs; ++i) transposed_[offset + i * outputs + o] = weights_[offset + o * inputs + i];
    }
  }
}

void MlpCpu::forward(const std::vector<Channels>& activations, std::size_t groups) const {
  for (int l = 0; l < layout_.layers(); ++l) {
    const bool relu = l + 1 < layout_.layers() || relu_output_;
    kernels_->forward(transposed_.data() + layout_.weight_offset(l), layout_.widths[l], layout_.widths[l + 1],
                      activations[l].data, activations[l].stride, activations[l + 1].data, activations[l + 1].stride,
                      groups, relu);
  }
}

void MlpCpu::backward(const std::vector<Channels>& activations, const std::vector<Channels>& gradients,
                      std::size_t groups, float* d_weights) const {
  for (int l = layout_.layers() - 1; l >= 0; --l) {
    const int inputs = layout_.widths[l], outputs = layout_.widths[l + 1];
    kernels_->backward_weights(activations[l].data, activations[l].stride, gradients[l + 1].data,
                               gradients[l + 1].stride, groups, inputs, outputs, d_weights + layout_.weight_offset(l));
    if (gradients[l].data == nullptr) continue;
    const float* relu_gate = l > 0 ? activations[l].data : nullptr;
    kernels_->backward_input(weights_.data() + layout_.weight_offset(l), inputs, outputs, gradients[l + 1].data,
                             gradients[l + 1].stride, gradients[l].data, gradients[l].stride, groups, relu_gate,
                             activations[l].stride);
  }
}

void MlpCpu::update(const std::vector<float>& d_weights, const AdamStep& step) {
  for (std::size_t i = 0; i < weights_.size(); ++i) {
    step.apply(d_weights[i], first_moments_[i], second_moments_[i], weights_[i]);
  }
  transpose_weights();
}

void MlpCpu::set_weights(const std::vector<float>& weights) {
  CNERF_CHECK_EQ(weights.size(), weights_.size());
  weights_.assign(weights.begin(), weights.end());
  transpose_weights();
}

void MlpCpu::append_state(const std::string& prefix, std::vector<StatePiece>& state) {
  state.push_back(state_piece(prefix + ".weights", weights_));
  state.push_back(state_piece(prefix + ".first_moments", first_moments_));
  state.push_back(state_piece(prefix + ".second_moments", second_moments_));
}

}  // namespace cnerf
