// The layer kernels, written once over lanes and compiled once per instruction set. See mlp_kernels.h.
//
// All three keep a block of sums in registers: 16 outputs of one group (AVX-512), so that a loaded weight or activation
// meets as many multiply-adds as there are registers for. Weights (at most 64 x 64) stay in L1.

#include "encoding/cpu/hash_grid_kernels.h"
#include "encoding/cpu/lanes.h"
#include "src/field/cpu/mlp_kernels.h"

namespace cnerf::CNERF_ISA {
namespace {

constexpr int kParts = kGroup / kWidth;        // registers a channel of a group takes
constexpr int kBlock = kWidth == 16 ? 16 : 4;  // channels summed at a time
static_assert(kBlock * kParts <= 16);

/// sums[o] = sum over i of w[i * w_stride + o] * in[i], for `block` successive o.
template <int block>
inline void weighted_sums(const float* w, int w_stride, int inputs, const float* in, Lanes (&sums)[block][kParts]) {
  for (int o = 0; o < block; ++o) {
    for (int p = 0; p < kParts; ++p) sums[o][p] = Lanes(0.0f);
  }
  for (int i = 0; i < inputs; ++i) {
    Lanes x[kParts];
    for (int p = 0; p < kParts; ++p) x[p] = Lanes::load(in + i * kGroup + p * kWidth);
    for (int o = 0; o < block; ++o) {
      const Lanes weight(w[i * w_stride + o]);
      for (int p = 0; p < kParts; ++p) sums[o][p] = fma(weight, x[p], sums[o][p]);
    }
  }
}

template <int block>
inline void forward_block(const float* w, int w_stride, int inputs, const float* in, float* out, bool relu) {
  Lanes sums[block][kParts];
  weighted_sums<block>(w, w_stride, inputs, in, sums);
  for (int o = 0; o < block; ++o) {
    for (int p = 0; p < kParts; ++p) {
      const Lanes value = relu ? where_positive(sums[o][p], sums[o][p]) : sums[o][p];
      value.store(out + o * kGroup + p * kWidth);
    }
  }
}

void forward(const float* w_transposed, int inputs, int outputs, const float* in, int in_stride, float* out,
             int out_stride, std::size_t groups, bool relu) {
  for (std::size_t g = 0; g < groups; ++g) {
    const float* x = in + g * std::size_t(in_stride) * kGroup;
    float* y = out + g * std::size_t(out_stride) * kGroup;
    int o = 0;
    for (; o + kBlock <= outputs; o += kBlock) {
      forward_block<kBlock>(w_transposed + o, outputs, inputs, x, y + o * kGroup, relu);
    }
    for (; o < outputs; o += 4) forward_block<4>(w_transposed + o, outputs, inputs, x, y + o * kGroup, relu);
  }
}

template <int block>
inline void backward_input_block(const float* w, int w_stride, int outputs, const float* d_out, float* d_in,
                                 const float* activation) {
  Lanes sums[block][kParts];
  weighted_sums<block>(w, w_stride, outputs, d_out, sums);
  for (int i = 0; i < block; ++i) {
    for (int p = 0; p < kParts; ++p) {
      const int at = i * kGroup + p * kWidth;
      const Lanes value = activation == nullptr ? sums[i][p] : where_positive(Lanes::load(activation + at), sums[i][p]);
      value.store(d_in + at);
    }
  }
}

void backward_input(const float* w, int inputs, int outputs, const float* d_out, int d_out_stride, float* d_in,
                    int d_in_stride, std::size_t groups, const float* activation, int activation_stride) {
  for (std::size_t g = 0; g < groups; ++g) {
    const float* dy = d_out + g * std::size_t(d_out_stride) * kGroup;
    float* dx = d_in + g * std::size_t(d_in_stride) * kGroup;
    const float* gate = activation == nullptr ? nullptr : activation + g * std::size_t(activation_stride) * kGroup;
    const auto gate_at = [&](int i) { return gate == nullptr ? nullptr : gate + i * kGroup; };
    int i = 0;
    for (; i + kBlock <= inputs; i += kBlock) {
      backward_input_block<kBlock>(w + i, inputs, outputs, dy, dx + i * kGroup, gate_at(i));
    }
    for (; i < inputs; i += 4) backward_input_block<4>(w + i, inputs, outputs, dy, dx + i * kGroup, gate_at(i));
  }
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
