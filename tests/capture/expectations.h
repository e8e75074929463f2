#pragma once
/// What tests of readers expect of poses, lenses and errors.

#include <filesystem>
#include <string>
#include <vector>

#include "src/capture/capture.h"

namespace cnerf::test {

/// Expects poses that agree to 1e-6, relative to the length of the translation.
void expect_same_pose(const Affined& found, const Affined& wanted);
/// Expects the ring of four cameras of fixtures.h, begun at another of them.
void expect_ring(const Capture& capture, int turned_by = 0);
/// Expects lenses that agree to 1e-6.
void expect_same_lens(const Intrinsics& found, const Intrinsics& wanted);
/// Expects an InputError whose message has all of these parts.
void expect_input_error(const std::filesystem::path& capture, const std::vector<std::string>& parts);

/// Expects a capture of four views to go on with three of them, and to say so, once one's image is gone.
void expect_missing_image_left_out(const std::filesystem::path& capture, const std::filesystem::path& image);

}  // namespace cnerf::test
