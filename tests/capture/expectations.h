#pragma once
/// What tests of readers expect of poses, lenses and errors.

#include <filesystem>
#include <string>
#include <vector>

#include "src/capture/camera.h"

namespace cnerf::test {

/// Expects poses that agree to 1e-6, relative to the length of the translation.
void expect_same_pose(const Affined& found, const Affined& wanted);
/// Expects lenses that agree to 1e-6.
void expect_same_lens(const Intrinsics& found, const Intrinsics& wanted);
/// Expects an InputError whose message has all of these parts.
void expect_input_error(const std::filesystem::path& capture, const std::vector<std::string>& parts);

}  // namespace cnerf::test
