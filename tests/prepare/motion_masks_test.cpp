#include "src/prepare/motion_masks.h"

#include <gtest/gtest.h>

#include "src/capture/load_capture.h"
#include "src/engine/engines.h"
#include "src/sample/sample_scene.h"
#include "tests/support/data.h"

namespace cnerf::prepare {
namespace {

/// A fit of fewer steps than a user's tells as much of so small a capture.
MotionMaskOptions quick() {
  MotionMaskOptions options;
  options.motion_steps = 150;
  return options;
}

struct Pasted {
  int x = 0, y = 0, side = 0;
  [[nodiscard]] bool has(int px, int py) const { return px >= x && px < x + side && py >= y && py < y + side; }
};

/// The sample scene, opaque, with a bright square that is somewhere else in every third view.
struct Disturbed {
  Capture capture;
  std::vector<Pasted> squares;  ///< by view; side 0 = none
};
Disturbed disturbed_sample(const std::filesystem::path& folder, bool disturb) {
  SampleSceneOptions options;
  options.views = 30;
  options.width = 120;
  options.height = 90;
  options.samples_per_pixel = 1;
  write_sample_scene(folder, options);
  Disturbed out{load_capture(folder), {}};
  out.capture.is_bounded_object = false;
  for (std::size_t v = 0; v < out.capture.views.size(); ++v) {
    MonoImage& image = out.capture.views[v].image;
    image.alpha.clear();
    Pasted square;
    if (disturb && v % 3 == 1) square = {30 + int(v * 7 % 50), 25 + int(v * 5 % 35), 14};
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) {
        if (square.has(x, y)) image.u8[std::size_t(y * image.width + x)] = 235;
      }
    }
    out.squares.push_back(square);
  }
  return out;
}

TEST(Motion, IsFoundWhereItIsAndHardlyElsewhere) {
  const test::TempDir folder;
  const Disturbed scene = disturbed_sample(folder / "sample", true);
  Observer observer;
  const auto masks = find_motion(scene.capture, quick(), folder / "work", cpu_engines(), observer);
  ASSERT_EQ(masks.size(), scene.capture.views.size());
  double found = 0, all = 0, wrong = 0, still = 0;
  for (std::size_t v = 0; v < masks.size(); ++v) {
    ASSERT_FALSE(masks[v].valid.empty());
    for (int y = 0; y < masks[v].height; ++y) {
      for (int x = 0; x < masks[v].width; ++x) {
        const bool hidden = masks[v].valid[std::size_t(y * masks[v].width + x)] == 0;
        const bool moved = scene.squares[v].has(x, y);
        (moved ? all : still) += 1;
        (moved ? found : wrong) += hidden;
      }
    }
  }
  std::printf("%.1f %% of what moved, %.2f %% of the rest\n", 100 * found / all, 100 * wrong / still);
  EXPECT_GT(found / all, 0.8);
  EXPECT_LT(wrong / still, 0.05);
  EXPECT_FALSE(std::filesystem::exists(folder / "work" / "motion.snapshot"));
}

TEST(Motion, AStillSceneIsLeftAlone) {
  const test::TempDir folder;
  double hidden = 0;
  Observer observer;
  const auto masks = find_motion(disturbed_sample(folder / "sample", false).capture, quick(), folder / "work",
                                 cpu_engines(), observer);
  for (const MotionMask& mask : masks) hidden += mask.share / double(masks.size());
  std::printf("%.2f %% hidden\n", 100 * hidden);
  EXPECT_LT(hidden, 0.03);
}

}  // namespace
}  // namespace cnerf::prepare
