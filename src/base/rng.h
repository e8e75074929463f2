#pragma once
/// Counter-based random numbers: a value is a pure function of (seed, stream, index), the same on CPU and GPU and for
/// any number of threads, so a training step can be repeated without replaying the run.

#include <cstddef>
#include <cstdint>

#include "src/base/host_device.h"

namespace cnerf {

/// A well mixed 64-bit hash of one word (the finaliser of SplitMix64, Steele et al. 2014).
CNERF_HD constexpr std::uint64_t mix_bits(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

/// The stream of random numbers for a purpose: its name's letters as one number, the first letter highest. Under one
/// seed, purposes of different names draw different numbers.
template <std::size_t size>
CNERF_HD constexpr std::uint64_t named_stream(const char (&name)[size]) {
  static_assert(size <= 9, "eight letters at most");
  std::uint64_t stream = 0;
  for (std::size_t i = 0; i + 1 < size; ++i) stream = stream << 8 | std::uint64_t(name[i]);
  return stream;
}

/// The generator: every draw names its index, there is no hidden state.
struct CounterRng {
  std::uint64_t key = 0;

  CNERF_HD constexpr CounterRng(std::uint64_t seed, std::uint64_t stream) : key(mix_bits(seed ^ mix_bits(stream))) {}

  [[nodiscard]] CNERF_HD constexpr std::uint64_t bits(std::uint64_t index) const {
    return mix_bits(key ^ mix_bits(index));
  }
  /// Uniform in [0, 1), 24 bits.
  [[nodiscard]] CNERF_HD constexpr float uniform(std::uint64_t index) const {
    return float(bits(index) >> 40) * 0x1p-24f;
  }
  /// Uniform integer in [0, n). The bias of at most n / 2^32 is below what any use here could notice.
  [[nodiscard]] CNERF_HD constexpr std::uint32_t below(std::uint64_t index, std::uint32_t n) const {
    return std::uint32_t(((bits(index) >> 32) * n) >> 32);
  }
};

/// Successive draws, for host code.
class SequentialRng {
 public:
  SequentialRng(std::uint64_t seed, std::uint64_t stream) : rng_(seed, stream) {}
  float uniform() { return rng_.uniform(next_++); }
  float uniform(float low, float high) { return low + (high - low) * uniform(); }
  std::uint32_t below(std::uint32_t n) { return rng_.below(next_++, n); }
  /// Standard normal (Box and Muller 1958).
  float normal();

 private:
  CounterRng rng_;
  std::uint64_t next_ = 0;
};

}  // namespace cnerf
