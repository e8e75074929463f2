#pragma once
/// Every instruction set this machine can run, for parametrised tests.

#include <vector>

#include "src/base/cpu_features.h"

namespace cnerf::test {

inline std::vector<IsaLevel> available_isas() {
  std::vector<IsaLevel> levels;
  for (const IsaLevel level : {IsaLevel::kGeneric, IsaLevel::kAvx2, IsaLevel::kAvx512}) {
    if (level <= detected_isa()) levels.push_back(level);
  }
  return levels;
}

/// Forces a level for the scope.
class ScopedIsa {
 public:
  explicit ScopedIsa(IsaLevel level) { force_isa(level); }
  ~ScopedIsa() { force_isa(detected_isa()); }
  ScopedIsa(const ScopedIsa&) = delete;
  ScopedIsa& operator=(const ScopedIsa&) = delete;
};

}  // namespace cnerf::test
