#pragma once
/// The small net as nested loops, in any number type: what the kernels are compared with.

#include <vector>

#include "src/field/mlp_layout.h"

namespace cnerf {

template <typename Real>
struct MlpReference {
  MlpLayout layout;
  std::vector<Real> weights;  ///< [layer][out, in]

  /// Activations of one sample: [0] the input, [layers()] the output; hidden ones after ReLU.
  [[nodiscard]] std::vector<std::vector<Real>> forward(const std::vector<Real>& input) const {
    std::vector<std::vector<Real>> activations = {input};
    for (int l = 0; l < layout.layers(); ++l) {
      const Real* w = weights.data() + layout.weight_offset(l);
      std::vector<Real> out(std::size_t(layout.widths[l + 1]), Real(0));
      for (int o = 0; o < layout.widths[l + 1]; ++o) {
        for (int i = 0; i < layout.widths[l]; ++i) out[o] += w[o * layout.widths[l] + i] * activations[l][i];
        if (l + 1 < layout.layers() && out[o] < Real(0)) out[o] = Real(0);
      }
      activations.push_back(std::move(out));
    }
    return activations;
  }

  /// Adds the gradient of the weights to `d_weights`; returns the gradient of the input.
  std::vector<Real> backward(const std::vector<std::vector<Real>>& activations, std::vector<Real> d_out,
                             std::vector<Real>& d_weights) const {
    for (int l = layout.layers() - 1; l >= 0; --l) {
      const std::size_t offset = layout.weight_offset(l);
      std::vector<Real> d_in(std::size_t(layout.widths[l]), Real(0));
      for (int o = 0; o < layout.widths[l + 1]; ++o) {
        if (l + 1 < layout.layers() && activations[l + 1][o] <= Real(0)) continue;
        for (int i = 0; i < layout.widths[l]; ++i) {
          const std::size_t at = offset + std::size_t(o * layout.widths[l] + i);
          d_weights[at] += d_out[o] * activations[l][i];
          d_in[i] += weights[at] * d_out[o];
        }
      }
      d_out = std::move(d_in);
    }
    return d_out;
  }
};

}  // namespace cnerf
