#pragma once
/// What colours a capture when the user names nothing.

#include <filesystem>

#include "src/base/observer.h"
#include "src/config/config.h"

namespace cnerf::pipeline {

/// Leaves a given `config.colorizer.spec` alone; else takes the key frames as references, or the photographs in the
/// capture's folder `references`, which `cnerf sample` writes there, or, without any, the built-in network. Says what
/// it chose. In each case it makes files of known colours absolute (known_color_files.h).
void choose_colorizer(const std::filesystem::path& capture, Config& config, Observer& observer);

/// New key frames say what the colours are; the colorizer that a run was made with, perhaps as a guess, does not.
/// @param named  what was asked for in this call
void prefer_key_frames(const ColorizerOptions& named, ColorizerOptions& of_run);

}  // namespace cnerf::pipeline
