#include "src/base/cpu_features.h"

#include <algorithm>
#include <cstdlib>

namespace cnerf {
namespace {

constexpr const char* kVariable = "CNERF_ISA";

IsaLevel level_from_environment() {
  const char* value = std::getenv(kVariable);
  const auto* named = std::ranges::find(kIsaLevels, std::string(value != nullptr ? value : ""), to_string);
  return named != kIsaLevels.end() ? *named : kIsaLevels.back();
}

}  // namespace

IsaLevel detected_isa() {
  if (kHasNeon) return IsaLevel::kNeon;  // as all of its family
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
      __builtin_cpu_supports("avx512bw")) {
    return __builtin_cpu_supports("avx512bf16") ? IsaLevel::kAvx512Bf16 : IsaLevel::kAvx512;
  }
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return IsaLevel::kAvx2;
#endif
  return IsaLevel::kGeneric;
}

IsaLevel active_isa() {
  static const IsaLevel detected = detected_isa();
  return std::min(detected, level_from_environment());
}

void choose_isa(const std::string& name) {
  if (name != "auto") ::setenv(kVariable, name.c_str(), 1);
}

std::string to_string(IsaLevel level) {
  switch (level) {
    case IsaLevel::kAvx512Bf16:
      return "avx512bf16";
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
