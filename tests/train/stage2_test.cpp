// What stage 2 asks a colorizer, and what it learns from the answers.

#include <set>

#include "src/base/error.h"
#include "src/train/chroma/base_chooser.h"
#include "src/train/luminance/luminance_model.h"
#include "tests/support/stage2_fixture.h"

namespace cnerf {
namespace {
using test::kAnswer;
using test::Listening;
using test::Wavering;
using Stage2 = test::Stage2Fixture;

/// Answers another colour about the places of bases when first asked, about one of them mostly, and to every third
/// question of the training.
class Erring final : public Colorizer {
 public:
  ChromaBatch colorize(const LightnessBatch& patches) override {
    return test::flat_answers(patches, [](const PatchOrigin& origin) {
      const bool is_base = origin.query >= std::uint64_t(1) << 32, is_first = is_base && origin.query >> 33 == 0;
      const bool is_wrong =
          is_first || (is_base && origin.view == "toy0" && origin.query % 8 < 5) || (!is_base && origin.query % 3 == 0);
      return test::FlatAnswer{is_wrong ? test::kOtherAnswer : kAnswer};
    });
  }
  [[nodiscard]] std::string name() const override { return "erring"; }
};

TEST_F(Stage2, PatchesSayWhereTheyComeFrom) {
  Listening colorizer;
  (void)colorize(small_options(), colorizer, take("a"));
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

// Networks on a GPU prepare themselves anew for each thread that asks.
TEST_F(Stage2, AsksFromOneThread) {
  Listening colorizer;
  (void)colorize(small_options(), colorizer, take("a"));
  EXPECT_EQ(colorizer.threads.size(), 1u);
}

/// Patches whose answers no step would learn from are not asked about; how many a query has changes nothing else.
TEST_F(Stage2, SizeOfQueriesChangesNothing) {
  Stage2Options options = small_options();
  options.patches = 20;
  options.distill_steps = 1;
  options.purify.enabled = false;
  for (const int batch : {3, 16}) {
    options.colorizer_batch = batch;
    Listening colorizer;
    (void)colorize(options, colorizer, take(std::to_string(batch)));
    const auto is_of_training = [](const PatchOrigin& origin) { return origin.query < std::uint64_t(1) << 32; };
    EXPECT_EQ(std::ranges::count_if(colorizer.origins, is_of_training), options.patches);
  }
  EXPECT_EQ(rendered("3").rgb, rendered("16").rgb);
}

TEST_F(Stage2, LearnsTheAnswer) {
  Listening colorizer;
  (void)colorize(small_options(), colorizer, take("a"));
  EXPECT_LT(distance_to_answer("a"), 5) << "grey is " << std::hypot(kAnswer.a, kAnswer.b);
}

TEST_F(Stage2, WhatTheColorizerIsNotSureOfGivesWay) {
  Stage2Options options = small_options();
  options.purify.enabled = false;
  options.sure_colors = 10;
  Wavering colorizer;
  (void)colorize(options, colorizer, take("weighed"));
  EXPECT_LT(distance_to_answer("weighed"), 5);
  options.sure_colors = 0;
  (void)colorize(options, colorizer, take("alike"));
  EXPECT_GT(distance_to_answer("alike"), 30) << "three of four say so";
}

// One view looks away from the scene.
TEST_F(Stage2, TheSkyFollowsWhatTheColorizerIsSureOf) {
  Affined& away = capture_.views[1].world_from_camera;
  away.linear = Mat3d::from_columns(-away.linear.column(0), away.linear.column(1), -away.linear.column(2));
  away.translation = away.translation * 10.0;
  LuminanceModel luminance = LuminanceModel::load(stage1(), cpu_engines());
  luminance.sky = {8, 4, {std::vector<float>(std::size_t(8) * 4, 0.25f)}};
  luminance.save(stage1());
  Stage2Options options = small_options();
  options.purify.enabled = false;
  const auto distance_of_sky = [&](double sure_colors) {
    options.sure_colors = sure_colors;
    Wavering colorizer;
    (void)colorize(options, colorizer, take(std::to_string(sure_colors)));
    const Vec3d seen = away.linear.column(2);
    const Ab color = ColorModel::load(take(std::to_string(sure_colors)), cpu_engines())
                         .sky.along({float(seen.x), float(seen.y), float(seen.z)});
    return std::hypot(color.a - kAnswer.a, color.b - kAnswer.b);
  };
  EXPECT_LT(distance_of_sky(10), 5);
  EXPECT_GT(distance_of_sky(0), 20) << "most answers are of the other colour";
}

// As the corners of a picture of an object before nothing: what is asked there teaches nothing, and ends nothing.
TEST_F(Stage2, PatchesThatShowNothingOfTheSceneAreSteps) {
  Affined& away = capture_.views[1].world_from_camera;
  away.translation = away.translation * 10.0;
  away.linear = Mat3d::from_columns(-away.linear.column(0), away.linear.column(1), -away.linear.column(2));
  Stage2Options options = small_options();
  options.colorizer_batch = 1;  // each step is looked at
  options.purify.enabled = false;
  Listening colorizer;
  const Stage2Report report = colorize(options, colorizer, take("a"));
  EXPECT_TRUE(std::ranges::any_of(colorizer.origins, [](const auto& origin) { return origin.view == "toy1"; }));
  EXPECT_EQ(report.accepted, 60);
  EXPECT_LT(distance_to_answer("a"), 5);
}

TEST_F(Stage2, BasesAreWhatTheAnswersAboutAllPlacesAgreeOn) {
  Stage2Options options = small_options();
  options.purify.opinions = 8;
  Erring colorizer;
  const Stage2Report report = colorize(options, colorizer, take("agreed"));
  EXPECT_GE(report.rejected, 20) << "a third of the answers is wrong, and no base is like them";
  EXPECT_LT(distance_to_answer("agreed"), 5);
  options.purify.opinions = 1;
  (void)colorize(options, colorizer, take("first"));
  EXPECT_GT(distance_to_answer("first"), 30) << "the first answers are wrong, and so is what is like them";
}

TEST_F(Stage2, EachKeyFrameIsABaseAndNoneIsPicked) {
  std::vector<KnownColors> known;
  for (const View& view : std::span(capture_.views).first(2)) {
    const int width = view.intrinsics.width, height = view.intrinsics.height;
    const std::vector<Ab> ab(std::size_t(width * height), Ab{20, 10});
    known.push_back({KnownColorKind::kKeyFrame, view.name, width, height, ab, std::vector<std::uint8_t>(ab.size(), 1)});
  }
  Stage2Options options = small_options();
  options.purify.base_images = 1;
  Listening colorizer;
  const Stage2Job job{capture_, stage1(), options, colorizer, known, take("a")};
  PatchQuestions questions;
  Session session(job, observer_);
  session.cache_views(cpu_engines());
  Questioner questioner(session, questions);
  BaseChooser chooser(session, questioner);
  const KnownColorMap map = known_color_map(session.views(), session.names(), known);
  std::set<std::size_t> views;
  for (const AnsweredPatch& base : chooser.choose(map)) views.insert(base.place.view);
  EXPECT_EQ(views, (std::set<std::size_t>{0, 1}));
  options.purify.picked_bases = "2,5";
  EXPECT_THROW(check_bases(options.purify, known), UsageError);
  EXPECT_NO_THROW(check_bases(options.purify, {}));
}

TEST_F(Stage2, SpreadWeightReachesTheField) {
  Stage2Options options = small_options();
  for (const double weight : {0.0, 20.0}) {
    options.spread_weight = weight;
    Listening colorizer;
    (void)colorize(options, colorizer, take(weight > 0 ? "close" : "free"));
  }
  EXPECT_NE(rendered("free").rgb, rendered("close").rgb);
  EXPECT_LT(distance_to_answer("close"), 5);
}

TEST_F(Stage2, ViewpointsAreViewsOfTheirJobAlone) {
  const View& near = capture_.views[0];
  Affined pose = near.world_from_camera;
  pose.translation = pose.translation * 0.9;
  const std::vector<Viewpoint> viewpoints = {{"viewpoint-1", camera_record(near.intrinsics, pose)}};
  const auto pixels = std::size_t(near.intrinsics.width) * std::size_t(near.intrinsics.height);
  const std::vector<KnownColors> known = {{KnownColorKind::kStrokes, "viewpoint-1", near.intrinsics.width,
                                           near.intrinsics.height, std::vector<Ab>(pixels, Ab{-40, 40}),
                                           std::vector<std::uint8_t>(pixels, 1)}};
  ViewCache views;
  Listening painted, plain;
  Stage2Job job{capture_, stage1(), small_options(), painted, known, take("painted"), false, &views};
  EXPECT_THROW((void)train_stage2(job, cpu_engines(), observer_), UsageError) << "no such view";
  job.viewpoints = viewpoints;
  (void)train_stage2(job, cpu_engines(), observer_);
  EXPECT_EQ(views.views().size(), 6u);
  const auto asks_there = [](const PatchOrigin& origin) { return origin.view == "viewpoint-1"; };
  EXPECT_TRUE(std::ranges::any_of(painted.origins, asks_there));

  (void)colorize(small_options(), plain, take("plain"), &views);
  EXPECT_FALSE(std::ranges::any_of(plain.origins, asks_there));
  EXPECT_LT(distance_to_answer("plain"), 5);
  EXPECT_GT(distance_to_answer("painted"), 2 * distance_to_answer("plain"))
      << "what is painted there is learned for all views";
}

TEST_F(Stage2, ViewsThatSomebodyStopsAreGoneOnWith) {
  const LuminanceModel luminance = LuminanceModel::load(stage1(), cpu_engines());
  const auto fill = [&](ViewCache& views, double until) {
    views.fill(luminance.seen(), capture_, luminance.frame, 40, [&](double fraction) {
      if (fraction > until) throw Interrupted("stopped");
    });
  };
  ViewCache whole, stopped;
  fill(whole, 1);
  EXPECT_THROW(fill(stopped, 0.9), Interrupted);
  EXPECT_LT(stopped.views().size(), whole.views().size());
  EXPECT_FALSE(stopped.views().empty());
  fill(stopped, 1);
  ASSERT_EQ(stopped.views().size(), whole.views().size());
  for (std::size_t v = 0; v < whole.views().size(); ++v) {
    EXPECT_EQ(stopped.views()[v].luminance, whole.views()[v].luminance) << v;
    EXPECT_EQ(stopped.views()[v].offsets, whole.views()[v].offsets) << v;
  }
}

TEST_F(Stage2, ATakeThatGoesOnWithoutQuestionsKeepsItsGalleries) {
  Listening colorizer;
  const Stage2Job job{capture_, stage1(), small_options(), colorizer, {}, take("a"), true};
  (void)train_stage2(job, cpu_engines(), observer_);
  const auto gallery = job.take.parent_path() / "accepted.png";
  const std::string before = read_text_file(gallery);
  (void)train_stage2(job, cpu_engines(), observer_);
  EXPECT_EQ(read_text_file(gallery), before);
}

TEST_F(Stage2, KeptViewsChangeNothing) {
  ViewCache views;
  for (const char* name : {"alone", "first", "second"}) {
    Listening colorizer;
    (void)colorize(small_options(), colorizer, take(name), name == std::string("alone") ? nullptr : &views);
  }
  EXPECT_EQ(views.views().size(), 5u);
  const RenderedImage alone = rendered("alone");
  for (const char* name : {"first", "second"}) EXPECT_EQ(rendered(name).rgb, alone.rgb) << name;

  Stage2Options smaller = small_options();
  smaller.working_resolution = 32;
  Listening colorizer;
  (void)colorize(smaller, colorizer, take("small"), &views);
  EXPECT_EQ(views.views().front().short_side(), 32) << "they are traced again at another size";
}

}  // namespace
}  // namespace cnerf
