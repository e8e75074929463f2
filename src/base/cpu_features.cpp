#include "src/base/cpu_features.h"

#include <algorithm>
#include <cstdlib>
#include <string_view>

namespace cnerf {
namespace {

IsaLevel level_from_environment() {
  const char* value = std::getenv("CNERF_ISA");
  if (value == nullptr) return IsaLevel::kAvx512;
  if (std::string_view(value) == "generic") return IsaLevel::kGeneric;
  if (std::string_view(value) == "avx2") return IsaLevel::kAvx2;
  return IsaLevel::kAvx512;
}

}  // namespace

IsaLevel detected_isa() {
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
    case IsaLevel::kGeneric:
      break;
  }
  return "generic";
}

}  // namespace cnerf
