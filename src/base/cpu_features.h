#pragma once
/// Which instruction set the CPU back ends run on.

#include <string>

namespace cnerf {

enum class IsaLevel { kGeneric = 0, kAvx2 = 1, kAvx512 = 2 };

/// The best level this processor and operating system support.
[[nodiscard]] IsaLevel detected_isa();
/// The level in use: the detected one, or lower when `force_isa` or $CNERF_ISA (generic, avx2, avx512) says so.
[[nodiscard]] IsaLevel active_isa();
/// Lowers the level for tests and comparisons; levels above the detected one are capped to it.
void force_isa(IsaLevel level);
[[nodiscard]] std::string to_string(IsaLevel level);

}  // namespace cnerf
