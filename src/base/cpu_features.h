#pragma once
/// The instruction set that the processor's kernels use.

#include <array>
#include <string>

namespace cnerf {

/// The last one has the float kernels of the one before it, but for the products of nets: those round what they
/// multiply to bf16 and add up floats.
enum class IsaLevel { kGeneric, kNeon, kAvx2, kAvx512, kAvx512Bf16 };

/// The levels that this program has kernels of, the lowest first.
#if defined(__aarch64__)
inline constexpr std::array kIsaLevels = {IsaLevel::kGeneric, IsaLevel::kNeon};
#else
inline constexpr std::array kIsaLevels = {IsaLevel::kGeneric, IsaLevel::kAvx2, IsaLevel::kAvx512,
                                          IsaLevel::kAvx512Bf16};
#endif
inline constexpr bool kHasNeon = kIsaLevels.back() == IsaLevel::kNeon;

/// The best level this processor and operating system support.
[[nodiscard]] IsaLevel detected_isa();
/// The level that an engine made now uses: the detected one, or a lower one that `choose_isa` or $CNERF_ISA (generic,
/// neon, avx2, avx512, avx512bf16) asks for.
[[nodiscard]] IsaLevel active_isa();
/// Engines made from now on use at most the level of this name, and so do plug-ins; "auto" changes nothing. To be
/// called while there is one thread.
void choose_isa(const std::string& name);
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
  return level >= IsaLevel::kAvx512 ? avx512 : level == IsaLevel::kAvx2 ? avx2 : generic;
}
/// @}

}  // namespace cnerf
