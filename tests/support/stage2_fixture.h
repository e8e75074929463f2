#pragma once
/// Stage 2 on a capture of next to nothing, with a colorizer that answers one colour.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "src/base/files.h"
#include "src/color/colorspace_math.h"
#include "src/train/chroma/injection.h"
#include "src/train/chroma/questioner.h"
#include "src/train/chroma/stage2.h"
#include "src/train/luminance/stage1.h"
#include "src/train/scene.h"
#include "tests/support/data.h"
#include "tests/support/toy_capture.h"

namespace cnerf::test {

inline constexpr Ab kAnswer = {12, -9}, kOtherAnswer = {-40, 30};

/// One colour all over a patch.
struct FlatAnswer {
  Ab color;
  std::optional<float> certainty = {};
};
/// @param answer_to  FlatAnswer(const PatchOrigin&)
template <typename AnswerTo>
ChromaBatch flat_answers(const LightnessBatch& patches, const AnswerTo& answer_to) {
  const std::size_t pixels = std::size_t(patches.height) * std::size_t(patches.width);
  ChromaBatch all{patches.batch, patches.height, patches.width, {}, {}};
  for (const PatchOrigin& origin : patches.origins) {
    const FlatAnswer answer = answer_to(origin);
    all.ab.insert(all.ab.end(), pixels, answer.color.a);
    all.ab.insert(all.ab.end(), pixels, answer.color.b);
    if (answer.certainty) all.certainty.insert(all.certainty.end(), pixels, *answer.certainty);
  }
  return all;
}

/// Answers one colour and keeps the questions' origins, and from which threads they came.
class Listening final : public Colorizer {
 public:
  ChromaBatch colorize(const LightnessBatch& patches) override {
    threads.insert(std::this_thread::get_id());
    origins.insert(origins.end(), patches.origins.begin(), patches.origins.end());
    return flat_answers(patches, [](const PatchOrigin&) { return FlatAnswer{kAnswer}; });
  }
  [[nodiscard]] std::string name() const override { return "listening"; }

  std::vector<PatchOrigin> origins;
  std::set<std::thread::id> threads;
};

/// Answers one colour and is sure, or another one, torn between 300: the latter three times as often.
class Wavering final : public Colorizer {
 public:
  ChromaBatch colorize(const LightnessBatch& patches) override {
    return flat_answers(patches, [](const PatchOrigin& origin) {
      return origin.query % 4 == 0 ? FlatAnswer{kAnswer, 0.1f} : FlatAnswer{kOtherAnswer, 1.0f / 300};
    });
  }
  [[nodiscard]] std::string name() const override { return "wavering"; }
};

class Stage2Fixture : public testing::Test {
 protected:
  void SetUp() override {
    capture_.views.back().held_out = true;
    static const std::vector<std::byte> trained = trained_stage1(capture_);  // the same for all tests of a process
    write_file(stage1(), trained);
  }

  static HashGridOptions small_grid() {
    return {.levels = 3, .log2_rows = 10, .coarsest_resolution = 4, .finest_resolution = 32};
  }
  static std::vector<std::byte> trained_stage1(const Capture& capture) {
    Stage1Options options;
    options.steps = 40;
    options.samples_per_step = 2048;
    options.steps_per_box = 64;
    options.grid = small_grid();
    options.occupancy.resolution = 32;
    const TempDir folder;
    Observer observer;
    (void)train_stage1({capture, options, folder / "stage1.snapshot"}, cpu_engines(), observer);
    return read_binary_file(folder / "stage1.snapshot");
  }
  static Stage2Options small_options() {
    Stage2Options options;
    options.patches = 60;
    options.patch_size = 16;
    options.rays_per_patch = 128;
    options.working_resolution = 40;  // the pictures themselves
    options.distill_steps = 0;
    options.grid = small_grid();
    return options;
  }
  [[nodiscard]] std::filesystem::path stage1() const { return folder_ / "stage1.snapshot"; }
  [[nodiscard]] std::filesystem::path take(const std::string& name) const {
    return folder_ / (name + "/take.snapshot");
  }

  /// @param views, questions, injection  as in Stage2Job
  Stage2Report colorize(const Stage2Options& options, Colorizer& colorizer, const std::filesystem::path& take,
                        ViewCache* views = nullptr, Questions* questions = nullptr,
                        const Injection* injection = nullptr) {
    return train_stage2({capture_, stage1(), options, colorizer, {}, take, false, views, questions, injection},
                        cpu_engines(), observer_);
  }

  [[nodiscard]] RenderedImage rendered(const std::string& name) const {
    const View& view = capture_.views.back();
    return Scene::load(stage1(), take(name), cpu_engines())->render(view.intrinsics, view.world_from_camera);
  }
  /// Mean ab distance to the answer where a pixel is opaque and light enough to have that colour.
  [[nodiscard]] double distance_to_answer(const std::string& name) const {
    const RenderedImage image = rendered(name);
    double sum = 0;
    int count = 0;
    for (std::size_t p = 0; p < image.opacity.size(); ++p) {
      if (image.opacity[p] < 0.9f || image.luminance[p] < 0.1f) continue;
      const Lab<float> lab = lab_from_linear_rgb(Vec3f{image.rgb[3 * p], image.rgb[3 * p + 1], image.rgb[3 * p + 2]});
      sum += std::hypot(lab.a - kAnswer.a, lab.b - kAnswer.b);
      ++count;
    }
    EXPECT_GT(count, 50);
    return sum / count;
  }

  Observer observer_;
  test::TempDir folder_;
  Capture capture_ = test::toy_capture(6, 48, 40);
};

}  // namespace cnerf::test
