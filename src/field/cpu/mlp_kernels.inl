// The layer kernels, written once over lanes and compiled once per instruction set. See mlp_kernels.h.
//
// All three keep a block of sums in registers: 8 outputs of three groups (AVX-512), so that a loaded weight or
// activation meets as many multiply-adds as there are registers for. Weights (at most 64 x 64) stay in L1.

#include <type_traits>

#include "encoding/cpu/hash_grid_kernels.h"
#include "encoding/cpu/lanes.h"
#include "src/field/cpu/mlp_kernels.h"

namespace cnerf::CNERF_ISA {
namespace {

constexpr int kParts = kGroup / kWidth;          // registers a channel of a group takes
constexpr int kTogether = kWidth == 16 ? 3 : 1;  // groups that share a loaded weight
constexpr int kBlock = kWidth == 16 ? 8 : 4;     // channels summed at a time
static_assert(kBlock * kParts * kTogether <= (kWidth == 16 ? 24 : 16));

/// sums[g][o] = sum over i of w[i * w_stride + o] * in[g][i], for `block` successive o and `together` successive
/// groups.
template <int block, int together>
inline void weighted_sums(const float* w, int w_stride, int inputs, const float* in, std::size_t in_step,
                          Lanes (&sums)[together][block][kParts]) {
  for (auto& group : sums) {
    for (auto& channel : group) {
      for (Lanes& s : channel) s = Lanes(0.0f);
    }
  }
  for (int i = 0; i < inputs; ++i) {
    Lanes x[together][kParts];
    for (int g = 0; g < together; ++g) {
      for (int p = 0; p < kParts; ++p) x[g][p] = Lanes::load(in + std::size_t(g) * in_step + i * kGroup + p * kWidth);
    }
    for (int o = 0; o < block; ++o) {
      const Lanes weight(w[i * w_stride + o]);
      for (int g = 0; g < together; ++g) {
        for (int p = 0; p < kParts; ++p) sums[g][o][p] = fma(weight, x[g][p], sums[g][o][p]);
      }
    }
  }
}

/// Calls `layer` for all groups, as many together as share weights, then one at a time: layer(constant, first group).
template <typename Layer>
inline void for_groups(std::size_t groups, const Layer& layer) {
  std::size_t g = 0;
  for (; g + kTogether <= groups; g += kTogether) layer(std::integral_constant<int, kTogether>(), g);
  for (; g < groups; ++g) layer(std::integral_constant<int, 1>(), g);
}

template <int block, int together>
inline void forward_block(const float* w, int w_stride, int inputs, const float* in, std::size_t in_step, float* out,
                          std::size_t out_step, bool relu) {
  Lanes sums[together][block][kParts];
  weighted_sums<block, together>(w, w_stride, inputs, in, in_step, sums);
  for (int g = 0; g < together; ++g) {
    for (int o = 0; o < block; ++o) {
      for (int p = 0; p < kParts; ++p) {
        const Lanes sum = sums[g][o][p];
        const Lanes value = relu ? where_positive(sum, sum) : sum;
        value.store(out + std::size_t(g) * out_step + o * kGroup + p * kWidth);
      }
    }
  }
}

void forward(const float* w_transposed, int inputs, int outputs, const float* in, int in_stride, float* out,
             int out_stride, std::size_t groups, bool relu) {
  const std::size_t in_step = std::size_t(in_stride) * kGroup, out_step = std::size_t(out_stride) * kGroup;
  for_groups(groups, [&](auto together, std::size_t g) {
    const float* x = in + g * in_step;
    float* y = out + g * out_step;
    int o = 0;
    for (; o + kBlock <= outputs; o += kBlock) {
      forward_block<kBlock, together>(w_transposed + o, outputs, inputs, x, in_step, y + o * kGroup, out_step, relu);
    }
    for (; o < outputs; o += 4) {
      forward_block<4, together>(w_transposed + o, outputs, inputs, x, in_step, y + o * kGroup, out_step, relu);
    }
  });
}

template <int block, int together>
inline void backward_input_block(const float* w, int w_stride, int outputs, const float* d_out, std::size_t d_out_step,
                                 float* d_in, std::size_t d_in_step, const float* activation,
                                 std::size_t activation_step) {
  Lanes sums[together][block][kParts];
  weighted_sums<block, together>(w, w_stride, outputs, d_out, d_out_step, sums);
  for (int g = 0; g < together; ++g) {
    for (int i = 0; i < block; ++i) {
      for (int p = 0; p < kParts; ++p) {
        const int at = i * kGroup + p * kWidth;
        const Lanes sum = sums[g][i][p];
        const Lanes value = activation == nullptr
                                ? sum
                                : where_positive(Lanes::load(activation + std::size_t(g) * activation_step + at), sum);
        value.store(d_in + std::size_t(g) * d_in_step + at);
      }
    }
  }
}

void backward_input(const float* w, int inputs, int outputs, const float* d_out, int d_out_stride, float* d_in,
                    int d_in_stride, std::size_t groups, const float* activation, int activation_stride) {
  const std::size_t dy_step = std::size_t(d_out_stride) * kGroup, dx_step = std::size_t(d_in_stride) * kGroup;
  const std::size_t gate_step = std::size_t(activation_stride) * kGroup;
  for_groups(groups, [&](auto together, std::size_t g) {
    const float* dy = d_out + g * dy_step;
    float* dx = d_in + g * dx_step;
    const auto gate_at = [&](int i) {
      return activation == nullptr ? nullptr : activation + g * gate_step + i * kGroup;
    };
    int i = 0;
    for (; i + kBlock <= inputs; i += kBlock) {
      backward_input_block<kBlock, together>(w + i, inputs, outputs, dy, dy_step, dx + i * kGroup, dx_step, gate_at(i),
                                             gate_step);
    }
    for (; i < inputs; i += 4) {
      backward_input_block<4, together>(w + i, inputs, outputs, dy, dy_step, dx + i * kGroup, dx_step, gate_at(i),
                                        gate_step);
    }
  });
}

/// d_w of `rows` outputs and `columns` inputs: sums stay in registers over all groups and are added across lanes once.
template <int rows, int columns>
inline void weight_gradient_block(const float* in, std::size_t in_step, const float* d_out, std::size_t d_out_step,
                                  std::size_t groups, float* d_w, int d_w_stride) {
  Lanes sums[rows][columns];
  for (auto& row : sums) {
    for (Lanes& s : row) s = Lanes(0.0f);
  }
  for (std::size_t g = 0; g < groups; ++g) {
    for (int p = 0; p < kParts; ++p) {
      Lanes x[columns];
      for (int c = 0; c < columns; ++c) x[c] = Lanes::load(in + g * in_step + c * kGroup + p * kWidth);
      for (int r = 0; r < rows; ++r) {
        const Lanes dy = Lanes::load(d_out + g * d_out_step + r * kGroup + p * kWidth);
        for (int c = 0; c < columns; ++c) sums[r][c] = fma(dy, x[c], sums[r][c]);
      }
    }
  }
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) d_w[r * d_w_stride + c] += sum(sums[r][c]);
  }
}

void backward_weights(const float* in, int in_stride, const float* d_out, int d_out_stride, std::size_t groups,
                      int inputs, int outputs, float* d_w) {
  constexpr int rows = kWidth == 16 ? 4 : 2;
  const std::size_t in_step = std::size_t(in_stride) * kGroup;
  const std::size_t d_out_step = std::size_t(d_out_stride) * kGroup;
  for (int o = 0; o < outputs; o += rows) {
    for (int i = 0; i < inputs; i += 4) {
      weight_gradient_block<rows, 4>(in + i * kGroup, in_step, d_out + o * kGroup, d_out_step, groups,
                                     d_w + o * inputs + i, inputs);
    }
  }
}

}  // namespace

const MlpKernels kMlpKernels = {forward, backward_input, backward_weights};

}  // namespace cnerf::CNERF_ISA
