#pragma once
/// What ends a process whose companions are lost.

#include "src/base/error.h"

namespace cnerf {

/// Another process that a launcher started together with this one died, stopped, failed or cannot be reached.
struct RankError : Error {
  explicit RankError(const std::string& message) : Error(ExitCode(74), message) {}
};

}  // namespace cnerf
