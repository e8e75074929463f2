// What stage 2 asks a colorizer, and what it learns from the answers, on a capture of next to nothing.

#include "src/train/stage2.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "src/color/colorspace_math.h"
#include "src/train/scene.h"
#include "src/train/stage1.h"
#include "tests/support/data.h"
#include "tests/support/toy_capture.h"

namespace cnerf {
namespace {

constexpr Ab kAnswer = {12, -9};

/// Answers one colour and keeps the questions' origins.
class Listening final : public Colorizer {
 public:
  ChromaBatch colorize(const LightnessBatch& patches) override {
    origins.insert(origins.end(), patches.origins.begin(), patches.origins.end());
    const std::size_t pixels = patches.lightness.size() / std::size_t(patches.batch);
    ChromaBatch answer{patches.batch, patches.height, patches.width, {}, {}};
    for (int i = 0; i < patches.batch; ++i) {
      answer.ab.insert(answer.ab.end(), pixels, kAnswer.a);
      answer.ab.insert(answer.ab.end(), pixels, kAnswer.b);
    }
    return answer;
  }
  [[nodiscard]] std::string name() const override { return "listening"; }

  std::vector<PatchOrigin> origins;
};

/// Answers another colour about the places of bases when first asked, about one of them mostly, and to every third
/// question of the training.
class Erring final : public Colorizer {
 public:
  ChromaBatch colorize(const LightnessBatch& patches) override {
    const std::size_t pixels = patches.lightness.size() / std::size_t(patches.batch);
    ChromaBatch answer{patches.batch, patches.height, patches.width, {}, {}};
    for (const PatchOrigin& origin : patches.origins) {
      const bool is_base = origin.query >= std::uint64_t(1) << 32, is_first = is_base && origin.query >> 33 == 0;
      const bool is_wrong =
          is_first || (is_base && origin.view == "toy0" && origin.query % 8 < 5) || (!is_base && origin.query % 3 == 0);
      const Ab color = is_wrong ? Ab{-40, 30} : kAnswer;
      answer.ab.insert(answer.ab.end(), pixels, color.a);
      answer.ab.insert(answer.ab.end(), pixels, color.b);
    }
    return answer;
  }
  [[nodiscard]] std::string name() const override { return "erring"; }
};

class Stage2 : public testing::Test {
 protected:
  void SetUp() override {
    Stage1Options options;
    options.steps = 40;
    options.samples_per_step = 2048;
    options.steps_per_box = 64;
    options.grid = small_grid();
    options.occupancy.resolution = 32;
    capture_.views.back().held_out = true;
    (void)train_stage1({capture_, options, stage1()}, cpu_engines(), observer_);
  }

  static HashGridOptions small_grid() {
    return {.levels = 3, .log2_rows = 10, .coarsest_resolution = 4, .finest_resolution = 32};
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

  Stage2Report colorize(const Stage2Options& options, Colorizer& colorizer, std::span<const KnownColors> known,
                        const std::filesystem::path& take, bool resume, std::vector<CachedView>* shared = nullptr) {
    return train_stage2({capture_, stage1(), options, colorizer, known, take, resume, shared}, cpu_engines(),
                        observer_);
  }

  [[nodiscard]] RenderedImage rendered(const std::string& name, std::shared_ptr<TraceMemory> memory = nullptr) const {
    const View& view = capture_.views.back();
    return Scene::load(stage1(), take(name), cpu_engines(), std::move(memory))
        ->render(view.intrinsics, view.world_from_camera);
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

TEST_F(Stage2, PatchesSayWhereTheyComeFrom) {
  Listening colorizer;
  (void)colorize(small_options(), colorizer, {}, take("a"), false);
  std::set<std::uint64_t> queries;
  for (const PatchOrigin& origin : colorizer.origins) {
    queries.insert(origin.query);
    EXPECT_NE(origin.view, capture_.views.back().name) << "is held out";
    EXPECT_GE(std::min(origin.left, origin.top), 0);
    EXPECT_LE(std::max(origin.left + origin.width, origin.top + origin.height), 1 + 1e-9);
    EXPECT_NEAR(origin.width * 48, origin.height * 40, 1e-6) << "patches are squares";
  }
  EXPECT_EQ(queries.size(), colorizer.origins.size()) << "every question has a number of its own";
  EXPECT_GE(queries.size(), 60u);
}

TEST_F(Stage2, ViewsAreAskedAboutWholeAndOnceFromNeighbourToNeighbour) {
  Stage2Options options = small_options();
  options.questions = "views";
  Listening colorizer;
  (void)colorize(options, colorizer, {}, take("a"), false);
  std::vector<std::string> asked;
  for (const PatchOrigin& origin : colorizer.origins) {
    asked.push_back(origin.view);
    EXPECT_EQ(origin.width, 1);
    EXPECT_EQ(origin.height, 1);
  }
  // Six cameras on a circle; the sixth is held out.
  EXPECT_EQ(asked, (std::vector<std::string>{"toy0", "toy1", "toy2", "toy3", "toy4"}));
}

TEST_F(Stage2, LearnsTheAnswerByClassificationAndPhotometrically) {
  for (const char* injection : {"classification", "photometric"}) {
    for (const char* questions : {"patches", "views"}) {
      Stage2Options options = small_options();
      options.injection = injection;
      options.questions = questions;
      Listening colorizer;
      const std::string name = std::string(injection) + "-" + questions;
      (void)colorize(options, colorizer, {}, take(name), false);
      EXPECT_LT(distance_to_answer(name), 5) << name << "; grey is " << std::hypot(kAnswer.a, kAnswer.b);
    }
  }
}

TEST_F(Stage2, BasesAreWhatTheAnswersAboutAllPlacesAgreeOn) {
  Stage2Options options = small_options();
  options.purify.opinions = 8;
  Erring colorizer;
  const Stage2Report report = colorize(options, colorizer, {}, take("agreed"), false);
  EXPECT_GE(report.rejected, 20) << "a third of the answers is wrong, and no base is like them";
  EXPECT_LT(distance_to_answer("agreed"), 5);
  options.purify.opinions = 1;
  (void)colorize(options, colorizer, {}, take("first"), false);
  EXPECT_GT(distance_to_answer("first"), 30) << "the first answers are wrong, and so is what is like them";
}

TEST_F(Stage2, SpreadWeightReachesTheField) {
  Stage2Options options = small_options();
  for (const double weight : {0.0, 20.0}) {
    options.spread_weight = weight;
    Listening colorizer;
    (void)colorize(options, colorizer, {}, take(weight > 0 ? "close" : "free"), false);
  }
  EXPECT_NE(rendered("free").rgb, rendered("close").rgb);
  EXPECT_LT(distance_to_answer("close"), 5);
}

TEST_F(Stage2, SharedViewsAndRememberedTracesChangeNothing) {
  std::vector<CachedView> shared;
  for (const char* name : {"alone", "first", "second"}) {
    Listening colorizer;
    (void)colorize(small_options(), colorizer, {}, take(name), false, name == std::string("alone") ? nullptr : &shared);
  }
  EXPECT_EQ(shared.size(), 5u);
  const RenderedImage alone = rendered("alone");
  const auto memory = make_trace_memory();
  for (const char* name : {"first", "second"}) {
    const RenderedImage image = rendered(name, memory);
    EXPECT_EQ(image.rgb, alone.rgb) << name;
    EXPECT_EQ(image.depth, alone.depth) << name;
  }
  EXPECT_EQ(rendered("alone", make_trace_memory(/*most_samples=*/1)).rgb, alone.rgb) << "nothing fits";
}

}  // namespace
}  // namespace cnerf
