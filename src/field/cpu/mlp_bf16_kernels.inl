// The layer kernels by dot products of bf16 pairs, for processors with AVX512_BF16: a lane adds two products to a
// float, at the price of one float multiply-add. What is read is rounded to the nearest bf16; sums stay floats. See
// mlp_kernels.h.

#include <immintrin.h>

#include <cstdint>
#include <new>
#include <type_traits>

#include "encoding/cpu/grouped.h"
#include "src/field/cpu/mlp_kernels.h"

namespace cnerf::avx512bf16 {
namespace {

constexpr int kTogether = 3;  // groups that share a loaded weight
constexpr int kBlock = 8;     // channels summed at a time
static_assert(kGroup == 16);

/// Words of two bf16 numbers each, for one call. No std::vector: what that compiles to here must not become the whole
/// program's (see lanes.h).
class Pairs {
 public:
  explicit Pairs(std::size_t words) : words_(static_cast<std::uint32_t*>(::operator new(words * 4, kLine))) {}
  ~Pairs() { ::operator delete(words_, kLine); }
  Pairs(Pairs&& other) noexcept : words_(other.words_) { other.words_ = nullptr; }
  Pairs& operator=(Pairs&&) = delete;
  [[nodiscard]] std::uint32_t* data() const { return words_; }

 private:
  static constexpr std::align_val_t kLine{64};
  std::uint32_t* words_;
};

__m512i rounded(__m512 low, __m512 high) {
  return __m512i(_mm512_cvtne2ps_pbh(high, low));
}

/// Word l has low[l] in its lower half and high[l] in its upper one.
__m512i paired(__m512 low, __m512 high) {
  alignas(64) static constexpr std::uint16_t kOrder[32] = {0,  16, 1,  17, 2,  18, 3,  19, 4,  20, 5,
                                                           21, 6,  22, 7,  23, 8,  24, 9,  25, 10, 26,
                                                           11, 27, 12, 28, 13, 29, 14, 30, 15, 31};
  return _mm512_permutexvar_epi16(_mm512_load_si512(kOrder), rounded(low, high));
}

__m512 add_products(__m512 sum, __m512i a, __m512i b) {
  return _mm512_dpbf16_ps(sum, __m512bh(a), __m512bh(b));
}

/// Rows 2k and 2k + 1 of w [rows, columns] together, as [rows / 2, columns].
Pairs paired_rows(const float* w, int rows, int columns) {
  Pairs pairs(std::size_t(rows / 2) * std::size_t(columns));
  for (int k = 0; k < rows / 2; ++k) {
    for (int c = 0; c < columns; c += kGroup) {
      const auto there = columns - c < kGroup ? __mmask16((1u << (columns - c)) - 1) : __mmask16(0xffff);
      const float* low = w + 2 * k * columns + c;
      const __m512i both = paired(_mm512_maskz_loadu_ps(there, low), _mm512_maskz_loadu_ps(there, low + columns));
      _mm512_mask_storeu_epi32(pairs.data() + k * columns + c, there, both);
    }
  }
  return pairs;
}

/// Some groups' channels, two by two: [inputs / 2, together, 16].
void pair_channels(const float* in, std::size_t in_step, int inputs, int together, const Pairs& pairs) {
  std::uint32_t* to = pairs.data();
  for (int k = 0; k < inputs / 2; ++k) {
    for (int g = 0; g < together; ++g, to += kGroup) {
      const float* low = in + std::size_t(g) * in_step + 2 * k * kGroup;
      _mm512_store_si512(to, paired(_mm512_loadu_ps(low), _mm512_loadu_ps(low + kGroup)));
    }
  }
}

/// Where a product goes to, and what becomes of it: zero where it is to be rectified and not above zero, or the gate is
/// not.
struct Output {
  float* values;
  std::size_t step;  ///< floats between groups
  bool relu = false;
  const float* gate = nullptr;
  std::size_t gate_step = 0;
};

/// For `block` successive columns and `together` successive groups: the sums over k of w[k][column] * in[k][group].
template <int block, int together>
void multiply_block(const std::uint32_t* w, int w_stride, int pairs, const std::uint32_t* in, Output to) {
  __m512 sums[together][block] = {};
  for (int k = 0; k < pairs; ++k) {
    __m512i x[together];
    for (int g = 0; g < together; ++g) x[g] = _mm512_load_si512(in + (k * together + g) * kGroup);
    for (int o = 0; o < block; ++o) {
      const __m512i weight = _mm512_set1_epi32(int(w[k * w_stride + o]));
      for (int g = 0; g < together; ++g) sums[g][o] = add_products(sums[g][o], x[g], weight);
    }
  }
  const auto rectified = __mmask16(to.relu ? 0xffff : 0);
#pragma GCC unroll 3  // these two, else the sums go through memory
  for (int g = 0; g < together; ++g) {
#pragma GCC unroll 8
    for (int o = 0; o < block; ++o) {
      const __m512 sum = sums[g][o];
      __m512 value = _mm512_mask_max_ps(sum, rectified, sum, _mm512_setzero_ps());  // NaN stays, but for rectified ones
      if (to.gate != nullptr) {
        const __m512 gate = _mm512_loadu_ps(to.gate + std::size_t(g) * to.gate_step + o * kGroup);
        value = _mm512_maskz_mov_ps(_mm512_cmp_ps_mask(gate, _mm512_setzero_ps(), _CMP_GT_OQ), value);
      }
      _mm512_storeu_ps(to.values + std::size_t(g) * to.step + o * kGroup, value);
    }
  }
}

/// The product of w [rows, columns], transposed, and the groups' `rows` channels.
void multiply(const float* w, int rows, int columns, const float* in, int in_stride, std::size_t groups, Output to) {
  const std::size_t in_step = std::size_t(in_stride) * kGroup;
  const Pairs weights = paired_rows(w, rows, columns);
  const Pairs channels(std::size_t(rows / 2) * kTogether * kGroup);
  const auto some_groups = [&](auto together, std::size_t first) {
    pair_channels(in + first * in_step, in_step, rows, together, channels);
    const auto block = [&](auto size, int c) {
      Output at = to;
      at.values += first * to.step + std::size_t(c) * kGroup;
      if (at.gate != nullptr) at.gate += first * to.gate_step + std::size_t(c) * kGroup;
      multiply_block<size, together>(weights.data() + c, columns, rows / 2, channels.data(), at);
    };
    int c = 0;
    for (; c + kBlock <= columns; c += kBlock) block(std::integral_constant<int, kBlock>(), c);
    for (; c < columns; c += 4) block(std::integral_constant<int, 4>(), c);
  };
  std::size_t g = 0;
  for (; g + kTogether <= groups; g += kTogether) some_groups(std::integral_constant<int, kTogether>(), g);
  if (groups - g == 2) some_groups(std::integral_constant<int, 2>(), g);
  if (groups - g == 1) some_groups(std::integral_constant<int, 1>(), g);
}

void forward(const float* w_transposed, int inputs, int outputs, const float* in, int in_stride, float* out,
             int out_stride, std::size_t groups, bool relu) {
  Output to{out, std::size_t(out_stride) * kGroup};
  to.relu = relu;
  multiply(w_transposed, inputs, outputs, in, in_stride, groups, to);
}

void backward_input(const float* w, int inputs, int outputs, const float* d_out, int d_out_stride, float* d_in,
                    int d_in_stride, std::size_t groups, const float* activation, int activation_stride) {
  Output to{d_in, std::size_t(d_in_stride) * kGroup};
  to.gate = activation;
  to.gate_step = std::size_t(activation_stride) * kGroup;
  multiply(w, outputs, inputs, d_out, d_out_stride, groups, to);
}

/// Channels with the samples of two groups in a row: [groups / 2, channels, 16 pairs]. Which samples make a pair does
/// not matter, as long as both factors of a product have the same ones.
Pairs paired_groups(const float* values, int stride, int channels, std::size_t groups) {
  const std::size_t step = std::size_t(stride) * kGroup;
  Pairs pairs((groups + 1) / 2 * std::size_t(channels) * kGroup);
  std::uint32_t* to = pairs.data();
  for (std::size_t g = 0; g < groups; g += 2) {
    for (int c = 0; c < channels; ++c, to += kGroup) {
      const float* low = values + g * step + c * kGroup;
      const __m512 high = g + 1 < groups ? _mm512_loadu_ps(low + step) : _mm512_setzero_ps();
      _mm512_store_si512(to, rounded(_mm512_loadu_ps(low), high));
    }
  }
  return pairs;
}

/// The sums of four registers.
__m128 four_sums(const __m512 (&v)[4]) {
  const __m512 ab = _mm512_unpacklo_ps(v[0], v[1]) + _mm512_unpackhi_ps(v[0], v[1]);
  const __m512 cd = _mm512_unpacklo_ps(v[2], v[3]) + _mm512_unpackhi_ps(v[2], v[3]);
  const __m512 abcd = _mm512_shuffle_ps(ab, cd, 0x44) + _mm512_shuffle_ps(ab, cd, 0xee);
  const __m256 half = _mm512_castps512_ps256(abcd) + _mm512_extractf32x8_ps(abcd, 1);
  return _mm256_castps256_ps128(half) + _mm256_extractf128_ps(half, 1);
}

void backward_weights(const float* in, int in_stride, const float* d_out, int d_out_stride, std::size_t groups,
                      int inputs, int outputs, float* d_w) {
  constexpr int kSide = 4;
  const Pairs x = paired_groups(in, in_stride, inputs, groups);
  const Pairs dy = paired_groups(d_out, d_out_stride, outputs, groups);
  for (int o = 0; o < outputs; o += kSide) {
    for (int i = 0; i < inputs; i += kSide) {
      __m512 sums[kSide][kSide] = {};
      const std::uint32_t *x_at = x.data() + i * kGroup, *dy_at = dy.data() + o * kGroup;
      for (std::size_t g = 0; g < groups; g += 2, x_at += inputs * kGroup, dy_at += outputs * kGroup) {
        __m512i columns[kSide];
        for (int c = 0; c < kSide; ++c) columns[c] = _mm512_load_si512(x_at + c * kGroup);
        for (int r = 0; r < kSide; ++r) {
          const __m512i row = _mm512_load_si512(dy_at + r * kGroup);
          for (int c = 0; c < kSide; ++c) sums[r][c] = add_products(sums[r][c], row, columns[c]);
        }
      }
      for (int r = 0; r < kSide; ++r) {
        float* to = d_w + (o + r) * inputs + i;
        _mm_storeu_ps(to, _mm_loadu_ps(to) + four_sums(sums[r]));
      }
    }
  }
}

}  // namespace

const MlpKernels kMlpKernels = {forward, backward_input, backward_weights};

}  // namespace cnerf::avx512bf16
