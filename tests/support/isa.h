#pragma once
/// Instruction sets, for parametrised tests.

#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

#include "src/base/cpu_features.h"

namespace cnerf::test {

/// Those of floats that this machine can run.
inline std::vector<IsaLevel> available_isas() {
  std::vector<IsaLevel> levels;
  for (const IsaLevel level : kIsaLevels) {
    if (level <= detected_isa() && level < IsaLevel::kAvx512Bf16) levels.push_back(level);
  }
  return levels;
}

/// The best of them.
inline IsaLevel best_float_isa() {
  return available_isas().back();
}

/// Engines that are made in this scope use this instruction set.
class ScopedIsa {
 public:
  explicit ScopedIsa(IsaLevel level) {
    if (const char* before = std::getenv(kName)) before_ = before;
    ::setenv(kName, to_string(level).c_str(), 1);
  }
  ~ScopedIsa() {
    if (before_) {
      ::setenv(kName, before_->c_str(), 1);
    } else {
      ::unsetenv(kName);
    }
  }
  ScopedIsa(const ScopedIsa&) = delete;
  ScopedIsa& operator=(const ScopedIsa&) = delete;

 private:
  static constexpr const char* kName = "CNERF_ISA";
  std::optional<std::string> before_;
};

}  // namespace cnerf::test
