#pragma once
/// What colours a capture when the user names nothing.

#include <filesystem>

#include "src/app/reporter.h"
#include "src/config/config.h"

namespace cnerf {

/// Leaves a given `config.colorizer.spec` alone; else takes the photographs in the capture's folder
/// `references`, which `cnerf sample` writes there, and says so.  @throws UsageError  when there is none: says what to
/// pass.
void choose_colorizer(const std::filesystem::path& capture, Config& config, Reporter& reporter);

}  // namespace cnerf
