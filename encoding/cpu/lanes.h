#pragma once
/// SIMD lanes. Included by per-ISA files only, which define CNERF_ISA (generic, neon, avx2, avx512) as the namespace
/// that everything here lives in: an inline function shared between files of different instruction sets would be one
/// symbol for the linker, compiled twice, and the baseline program could end up with the AVX-512 copy.
///
/// Lane types are classes, not vector typedefs: typedefs of different namespaces mangle alike and are not found by
/// argument-dependent lookup.

#include <cstdint>
#include <cstring>

#if defined(__AVX512F__) || defined(__FMA__)
#include <immintrin.h>
#elif defined(CNERF_NEON)  // arm64 has it without a compiler's option, in the generic file too
#include <arm_neon.h>
#endif

#ifndef CNERF_ISA
#error "define CNERF_ISA before including lanes.h"
#endif

namespace cnerf::CNERF_ISA {

#if defined(__AVX512F__)
inline constexpr int kWidth = 16;
#elif defined(__AVX2__)
inline constexpr int kWidth = 8;
#else
inline constexpr int kWidth = 4;
#endif

/// kWidth unsigned integers.
struct LanesU32 {
  using Raw = std::uint32_t __attribute__((vector_size(4 * kWidth)));
  Raw raw;

  LanesU32() = default;
  explicit LanesU32(Raw r) : raw(r) {}
  explicit LanesU32(std::uint32_t all) : raw(Raw{} + all) {}
  void store(std::uint32_t* to) const { std::memcpy(to, &raw, sizeof raw); }

  friend LanesU32 operator+(LanesU32 a, LanesU32 b) { return LanesU32(a.raw + b.raw); }
  friend LanesU32 operator*(LanesU32 a, LanesU32 b) { return LanesU32(a.raw * b.raw); }
  friend LanesU32 operator^(LanesU32 a, LanesU32 b) { return LanesU32(a.raw ^ b.raw); }
  friend LanesU32 operator&(LanesU32 a, LanesU32 b) { return LanesU32(a.raw & b.raw); }
  friend LanesU32 smaller(LanesU32 a, LanesU32 b) { return LanesU32(a.raw < b.raw ? a.raw : b.raw); }
};

/// kWidth floats.
struct Lanes {
  using Raw = float __attribute__((vector_size(4 * kWidth)));
  using RawI32 = std::int32_t __attribute__((vector_size(4 * kWidth)));
  Raw raw;

  Lanes() = default;
  explicit Lanes(Raw r) : raw(r) {}
  explicit Lanes(float all) : raw(Raw{} + all) {}
  static Lanes load(const float* from) {
    Lanes lanes;
    std::memcpy(&lanes.raw, from, sizeof lanes.raw);
    return lanes;
  }
  void store(float* to) const { std::memcpy(to, &raw, sizeof raw); }

  friend Lanes operator+(Lanes a, Lanes b) { return Lanes(a.raw + b.raw); }
  friend Lanes operator-(Lanes a, Lanes b) { return Lanes(a.raw - b.raw); }
  friend Lanes operator*(Lanes a, Lanes b) { return Lanes(a.raw * b.raw); }
  /// `value` where `gate` > 0, else 0.
  friend Lanes where_positive(Lanes gate, Lanes value) {
    return Lanes(reinterpret_cast<Raw>(reinterpret_cast<RawI32>(value.raw) & (gate.raw > Raw{})));
  }
  /// Truncates; positions are never negative, so this is the floor.
  friend LanesU32 to_index(Lanes a) {
    return LanesU32(reinterpret_cast<LanesU32::Raw>(__builtin_convertvector(a.raw, RawI32)));
  }
  friend void to_real(LanesU32 i, Lanes& x) { x.raw = __builtin_convertvector(reinterpret_cast<RawI32>(i.raw), Raw); }
};

/// a * b + c, rounded once where the instruction set has it.
inline Lanes fma(Lanes a, Lanes b, Lanes c) {
#if defined(__AVX512F__)
  return Lanes(Lanes::Raw(_mm512_fmadd_ps(__m512(a.raw), __m512(b.raw), __m512(c.raw))));
#elif defined(__FMA__)
  return Lanes(Lanes::Raw(_mm256_fmadd_ps(__m256(a.raw), __m256(b.raw), __m256(c.raw))));
#elif defined(CNERF_NEON)
  return Lanes(Lanes::Raw(vfmaq_f32(float32x4_t(c.raw), float32x4_t(a.raw), float32x4_t(b.raw))));
#else
  return a * b + c;
#endif
}

inline float sum(Lanes a) {
#if defined(__AVX512F__)
  return _mm512_reduce_add_ps(__m512(a.raw));
#else
  float total = 0;
  for (int i = 0; i < kWidth; ++i) total += a.raw[i];
  return total;
#endif
}

/// The four features of one row of the hash table.
struct Row4 {
  using Raw = float __attribute__((vector_size(16)));
  Raw raw;

  static Row4 zero() { return {Raw{}}; }
  static Row4 load(const float* from) {
    Row4 row;
    std::memcpy(&row.raw, from, sizeof row.raw);
    return row;
  }
  void store(float* to) const { std::memcpy(to, &raw, sizeof raw); }
  friend Row4 operator+(Row4 a, Row4 b) { return {a.raw + b.raw}; }
  friend Row4 operator*(Row4 a, Row4 b) { return {a.raw * b.raw}; }
};

/// weight * row + sum, rounded once where the instruction set has it.
inline Row4 fma(float weight, Row4 row, Row4 sum) {
#if defined(__FMA__) || defined(__AVX512F__)
  return {Row4::Raw(_mm_fmadd_ps(_mm_set1_ps(weight), __m128(row.raw), __m128(sum.raw)))};
#elif defined(CNERF_NEON)
  return {Row4::Raw(vfmaq_n_f32(float32x4_t(sum.raw), float32x4_t(row.raw), weight))};
#else
  return {row.raw * weight + sum.raw};
#endif
}

/// Transposes four rows: afterwards row f holds feature f of the four.
inline void transpose(Row4& a, Row4& b, Row4& c, Row4& d) {
  const Row4::Raw ab_low = __builtin_shufflevector(a.raw, b.raw, 0, 4, 1, 5);
  const Row4::Raw ab_high = __builtin_shufflevector(a.raw, b.raw, 2, 6, 3, 7);
  const Row4::Raw cd_low = __builtin_shufflevector(c.raw, d.raw, 0, 4, 1, 5);
  const Row4::Raw cd_high = __builtin_shufflevector(c.raw, d.raw, 2, 6, 3, 7);
  a.raw = __builtin_shufflevector(ab_low, cd_low, 0, 1, 4, 5);
  b.raw = __builtin_shufflevector(ab_low, cd_low, 2, 3, 6, 7);
  c.raw = __builtin_shufflevector(ab_high, cd_high, 0, 1, 4, 5);
  d.raw = __builtin_shufflevector(ab_high, cd_high, 2, 3, 6, 7);
}

}  // namespace cnerf::CNERF_ISA
