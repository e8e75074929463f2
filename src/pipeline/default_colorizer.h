#pragma once
/// What colours a capture when the user names nothing.

#include <filesystem>

#include "src/base/observer.h"
#include "src/capture/capture.h"
#include "src/config/config.h"

namespace cnerf::pipeline {

/// Keeps a given `config.colorizer.spec`; else takes the key frames as references, or the photographs in the capture's
/// folder `references`, which `cnerf sample` writes there, or, without any, the built-in network. Says what it chose.
/// In each case it makes files of known colours absolute (known_color_files.h), and those of the spec that are not
/// found in the capture.
/// @param source  a capture, or what one is yet to be made of
void choose_colorizer(const std::filesystem::path& source, Config& config, Observer& observer);
void choose_colorizer(const Capture& capture, Config& config, Observer& observer);

/// New key frames say what the colours are; the colorizer that a run was made with, perhaps as a guess, does not.
/// @param named  what was asked for in this call
void prefer_key_frames(const ColorizerOptions& named, ColorizerOptions& of_run);

}  // namespace cnerf::pipeline
