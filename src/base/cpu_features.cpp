#include "src/base/cpu_features.h"

#include <algorithm>
#include <cstdlib>

namespace cnerf {
namespace {

IsaLevel level_from_environment() {
  const char* value = std::getenv("CNERF_ISA");
  const auto* named = std::ranges::find(kIsaLevels, std::string(value != nullptr ? value : ""), to_string);
  return named != kIsaLevels.end() ? *named : kIsaLevels.back();
}

}  // namespace

IsaLevel detected_isa() {
  if (kHasNeon) return IsaLevel::kNeon;  // as all of its family
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
      __builtin_cpu_supports("avx512bw")) {
    return IsaLevel::kAvx512;
  }
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return IsaLevel::kAvx2;
#endif
  return IsaLevel::kGeneric;
}

IsaLevel active_isa() {
  static const IsaLevel detected = detected_isa();
  return std::min(detected, level_from_environment());
}

std::string to_string(IsaLevel level) {
  switch (level) {
    case IsaLevel::kAvx512:
      return "avx512";
    case IsaLevel::kAvx2:
      return "avx2";
    case IsaLevel::kNeon:
      return "neon";
    case IsaLevel::kGeneric:
      break;
  }
  return "generic";
}

}  // namespace cnerf
