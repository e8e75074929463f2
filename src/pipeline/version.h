#pragma once
/// What this build is.

#include <string>

namespace cnerf::pipeline {

/// "1.0.0", by semantic versioning.
[[nodiscard]] std::string version_text();

}  // namespace cnerf::pipeline
