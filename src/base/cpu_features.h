#pragma once
/// The instruction set that the processor's kernels use.

#include <array>
#include <string>

namespace cnerf {

enum class IsaLevel { kGeneric, kNeon, kAvx2, kAvx512 };

/// The levels that this program has kernels of, the lowest first.
#if defined(__aarch64__)
inline constexpr std::array kIsaLevels = {IsaLevel::kGeneric, IsaLevel::kNeon};
#else
inline constexpr std::array kIsaLevels = {IsaLevel::kGeneric, IsaLevel::kAvx2, IsaLevel::kAvx512};
#endif
inline constexpr bool kHasNeon = kIsaLevels.back() == IsaLevel::kNeon;

/// The best level this processor and operating system support.
[[nodiscard]] IsaLevel detected_isa();
/// The level that an engine made now uses: the detected one, or a lower one that $CNERF_ISA (generic, neon, avx2,
/// avx512) asks for.
[[nodiscard]] IsaLevel active_isa();
[[nodiscard]] std::string to_string(IsaLevel level);

/// Of what is compiled once per instruction set, the one for `active_isa()`.
/// @{
template <typename Kernels>
const Kernels& kernels_of_isa(const Kernels& generic, const Kernels& neon) {
  return active_isa() == IsaLevel::kNeon ? neon : generic;
}
template <typename Kernels>
const Kernels& kernels_of_isa(const Kernels& generic, const Kernels& avx2, const Kernels& avx512) {
  const IsaLevel level = active_isa();
  return level == IsaLevel::kAvx512 ? avx512 : level == IsaLevel::kAvx2 ? avx2 : generic;
}
/// @}

}  // namespace cnerf
