#include "src/base/cpu_features.h"

#include <algorithm>
#include <cstdlib>
#include <iterator>

namespace cnerf {
namespace {

constexpr IsaLevel kLevels[] = {IsaLevel::kGeneric, IsaLevel::kAvx2, IsaLevel::kAvx512, IsaLevel::kAvx512Bf16};

constexpr const char* kVariable = "CNERF_ISA";

IsaLevel level_from_environment() {
  const char* value = std::getenv(kVariable);
  for (const IsaLevel level : kLevels) {
    if (value != nullptr && to_string(level) == value) return level;
  }
  return kLevels[std::size(kLevels) - 1];
}

}  // namespace

IsaLevel detected_isa() {
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
    case IsaLevel::kGeneric:
      break;
  }
  return "generic";
}

}  // namespace cnerf
