#pragma once
/// Runs Blender headless on the set-up script of a bake and reads what it rendered.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace cnerf::test {

/// Linear, colour premultiplied by opacity.
struct RenderedExr {
  int width = 0, height = 0;
  std::vector<float> rgba;  ///< [H, W, 4]

  [[nodiscard]] const float* pixel(int x, int y) const { return &rgba[4 * (std::size_t(y) * width + x)]; }
};

/// The Blender of $PATH, if there is one.
[[nodiscard]] std::optional<std::filesystem::path> find_blender();

/// `blender -b --python SETUP [--python AFTER] -- ARGUMENTS`; its output goes to blender.log beside the script.
/// @return the exit status.
int run_blender(const std::filesystem::path& setup, const std::string& arguments,
                const std::filesystem::path& after = {});

/// A picture rendered with `--exact` and these further arguments.  @throws std::runtime_error with Blender's log.
[[nodiscard]] RenderedExr render_exact(const std::filesystem::path& setup, const std::string& arguments);

/// A picture for each of these further arguments, as `render_exact` makes it of each, from one start of Blender.
/// @throws likewise
[[nodiscard]] std::vector<RenderedExr> render_each_exact(const std::filesystem::path& setup,
                                                         const std::vector<std::string>& arguments);

/// Pictures by these cameras of equal size, in their order, from one start of Blender.  @throws likewise
[[nodiscard]] std::vector<RenderedExr> render_cameras(const std::filesystem::path& setup, const std::string& arguments,
                                                      const std::vector<std::string>& cameras);

/// Reads an EXR with channels R, G, B, A of 32 bits; opaque where A is missing.
[[nodiscard]] RenderedExr read_exr(const std::filesystem::path& file);

}  // namespace cnerf::test

#define CNERF_REQUIRE_BLENDER() \
  if (!::cnerf::test::find_blender()) GTEST_SKIP() << "needs the program blender in $PATH"
