#include "src/base/cpu_features.h"

#include <algorithm>
#include <cstdlib>
#include <optional>
#include <string_view>

namespace cnerf {
namespace {

std::optional<IsaLevel> forced_level;  // NOLINT: a process-wide choice, set by tests and by the environment

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
  static const IsaLevel allowed = std::min(detected_isa(), level_from_environment());
  return forced_level ? std::min(*forced_level, detected_isa()) : allowed;
}

void force_isa(IsaLevel level) {
  forced_level = level;
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
