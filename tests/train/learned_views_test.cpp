// What a training learned of its views reaches the capture that everything behind it reads, and no forged file reaches
// it.

#include "src/train/luminance/learned_views.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "src/base/files.h"
#include "src/train/luminance/luminance_model.h"
#include "src/train/luminance/stage1.h"
#include "tests/support/data.h"
#include "tests/support/engine_state.h"
#include "tests/support/toy_capture.h"

namespace cnerf {
namespace {

using testing::HasSubstr;

SceneFrame frame_of_half() {
  SceneFrame frame;
  frame.unit_per_world = 0.5;
  return frame;
}

/// Seven views, the fourth held out.
Capture clip() {
  Capture capture = test::toy_capture(7);
  capture.views[3].held_out = true;
  return capture;
}

std::vector<ViewCorrection> gains(const std::vector<float>& logarithms) {
  std::vector<ViewCorrection> corrections;
  for (const float gain : logarithms) corrections.push_back({gain, {}, {}});
  return corrections;
}

TEST(LuminanceModel, CanBeAsBrightAsPicturesAreAtOneExposureButForWhatIsMasked) {
  const auto most_of = [](const Capture& capture) {
    return LuminanceModel::create(capture, {}, cpu_engines()).max_luminance;
  };
  Capture capture = clip();
  EXPECT_EQ(most_of(capture), 1.0f);
  MonoImage& dark = capture.views[1].image;
  dark.exposure = 0.25f;
  dark.u8[7] = 255;
  EXPECT_NEAR(most_of(capture), 4, 1e-3f);
  dark.mask.assign(dark.pixel_count(), 255);
  dark.mask[7] = 0;
  EXPECT_LT(most_of(capture), 3);
  EXPECT_GT(most_of(capture), 1);
}

TEST(LuminanceModel, RefusesMoreSamplesOfARayThanAreLookedAt) {
  const Capture boxed = test::toy_capture(6, 24, 20, true), open = test::toy_capture(6);
  const auto create = [](const Capture& capture, int steps_per_box, double cone_angle) {
    Stage1Options options;
    options.grid = {.levels = 2, .log2_rows = 8, .coarsest_resolution = 4, .finest_resolution = 16};
    options.occupancy.resolution = 16;
    options.steps_per_box = steps_per_box;
    options.cone_angle = cone_angle;
    return LuminanceModel::create(capture, options, cpu_engines()).frame.cascades;
  };
  constexpr double kUsual = 1.0 / 64;
  EXPECT_EQ(create(boxed, 591, kUsual), 1);
  EXPECT_THAT([&] { (void)create(boxed, 592, kUsual); },
              testing::ThrowsMessage<UsageError>(testing::AllOf(HasSubstr("stage1.steps_per_box: "), HasSubstr("1024"),
                                                                HasSubstr("592"), HasSubstr("1026"))));
  EXPECT_EQ(create(open, 2048, kUsual), 3) << "whose steps grow";
  EXPECT_THAT([&] { (void)create(open, 2048, 1e-3); },
              testing::ThrowsMessage<UsageError>(HasSubstr("stage1.cone_angle")));
}

TEST(LearnedViews, NeighboursTellTheExposureOfAViewThatWasHeldOut) {
  Capture capture = clip();
  const std::vector<float> before = {0, 0.1f, 0.2f, 0.4f, 0.5f, 0.6f};
  EXPECT_NEAR(log_gains(capture, gains(before))[3], 0.3f, 1e-6f) << "exposures that rise steadily";
  const std::vector<float> any = {0.3f, -0.3f, 0.3f, 0.3f, -0.3f, 0.3f};
  EXPECT_EQ(log_gains(capture, gains(any))[3], 0.0f) << "exposures that say nothing of their neighbours";

  const float light = capture.views[3].image.luminance(5);
  apply_learned_views(capture, {frame_of_half(), gains(before), {}});
  EXPECT_NEAR(capture.views[3].image.luminance(5), light / std::exp(0.3f), 1e-6f);
  EXPECT_EQ(capture.views[0].image.exposure, 1.0f);
  EXPECT_NEAR(capture.views[6].image.exposure, std::exp(0.6f), 1e-6f);
}

TEST(LearnedViews, CamerasMoveAsTheirRaysDidInTraining) {
  Capture capture = clip();
  std::vector<ViewCorrection> corrections(6);
  corrections[1] = {0, {0.01f, -0.02f, 0.03f}, {0.004f, 0, -0.002f}};
  const SceneFrame frame = frame_of_half();
  const View given = capture.views[1], held_out = capture.views[3];
  const PixelPosition pixel = {3.5, 17.5};
  const Ray in_training =
      corrections[1].applied_to(UnitCamera(given.intrinsics, given.world_from_camera, frame).ray(pixel));
  apply_learned_views(capture, {frame, corrections, {}});
  const Ray behind = UnitCamera(given.intrinsics, capture.views[1].world_from_camera, frame).ray(pixel);
  EXPECT_LT(length(behind.origin - in_training.origin), 1e-6f);
  EXPECT_LT(length(behind.direction - in_training.direction), 1e-6f);
  EXPECT_NEAR(capture.views[1].world_from_camera.linear.determinant(), 1, 1e-12);
  EXPECT_EQ(capture.views[3].world_from_camera, held_out.world_from_camera) << "nobody knows where it stood";
}

TEST(LearnedViews, HeldOutViewsGetTheLensTheyShare) {
  Capture capture = clip();
  capture.views[5].intrinsics.fx = capture.views[5].intrinsics.fy = 40;  // another lens, the second one
  capture.views[6].intrinsics.fx = 50;                                   // one that no training view has
  capture.views[6].held_out = true;
  LearnedViews learned{frame_of_half(), std::vector<ViewCorrection>(5), std::vector<LensCorrection>(2)};
  learned.lenses[0].log_focal = 0.1f;
  learned.lenses[1].k1 = 0.05f;
  const Intrinsics first = capture.views[0].intrinsics, lone = capture.views[6].intrinsics;
  apply_learned_views(capture, learned);
  EXPECT_NEAR(capture.views[0].intrinsics.fx, first.fx * std::exp(0.1), 1e-6);
  EXPECT_EQ(capture.views[3].intrinsics, capture.views[0].intrinsics) << "held out, the same lens";
  EXPECT_EQ(capture.views[5].intrinsics.model, LensModel::kOpenCv);
  EXPECT_NEAR(capture.views[5].intrinsics.distortion[0], 0.05, 1e-8);
  EXPECT_EQ(capture.views[6].intrinsics, lone);
}

Stage1Options learning_steps() {
  Stage1Options options;
  options.steps = 24;
  options.samples_per_step = 1024;
  options.steps_per_box = 32;
  options.grid = {.levels = 3, .log2_rows = 8, .coarsest_resolution = 4, .finest_resolution = 16};
  options.occupancy.resolution = 32;
  options.checkpoint_every = 0;
  options.poses = options.lenses = true;
  return options;
}

class StoredViews : public testing::Test {
 protected:
  StoredViews() : job_{capture_, options_, folder_ / "stage1.snapshot"} {
    Observer observer;
    train_stage1(job_, cpu_engines(), observer);
  }

  test::TempDir folder_;
  Capture capture_ = clip();
  Stage1Options options_ = learning_steps();
  Stage1Job job_;
};

TEST_F(StoredViews, AreReadFromTheSnapshotAlone) {
  const LearnedViews stored = LuminanceModel::learned_views_in(job_.snapshot);
  const auto model = LuminanceModel::load(job_.snapshot, cpu_engines());
  const std::vector<ViewCorrection> learned = model.engine->view_corrections();
  ASSERT_EQ(stored.corrections.size(), 6u);
  float size = 0;
  for (std::size_t v = 0; v < learned.size(); ++v) {
    EXPECT_EQ(stored.corrections[v].log_gain, learned[v].log_gain);
    EXPECT_EQ(stored.corrections[v].turn, learned[v].turn);
    EXPECT_EQ(stored.corrections[v].shift, learned[v].shift);
    size += length(learned[v].turn) + std::abs(learned[v].log_gain);
  }
  EXPECT_GT(size, 0);
  const std::vector<LensCorrection> lenses = model.engine->lens_corrections();
  ASSERT_EQ(stored.lenses.size(), 1u);
  EXPECT_EQ(stored.lenses[0].log_focal, lenses[0].log_focal);
  EXPECT_EQ(stored.lenses[0].p2, lenses[0].p2);
  EXPECT_NE(stored.lenses[0].log_focal, 0);
  EXPECT_EQ(stored.frame.unit_per_world, model.frame.unit_per_world);
}

TEST_F(StoredViews, GoOnBitForBit) {
  const auto file = folder_ / "resumed.snapshot";
  // Rates follow the steps of the whole training: the halves are steps of one engine, saved and loaded in between.
  auto through = LuminanceModel::create(capture_, options_, cpu_engines());
  through.engine->set_views(training_views(capture_, through.frame));
  for (int i = 0; i < 12; ++i) through.engine->step(1e-2f);
  through.save(file);
  auto resumed = LuminanceModel::load(file, cpu_engines());
  resumed.engine->set_views(training_views(capture_, resumed.frame));
  for (int i = 0; i < 12; ++i) {
    through.engine->step(1e-2f);
    resumed.engine->step(1e-2f);
  }
  const std::vector<StatePiece> a = through.engine->state(), b = resumed.engine->state();
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_TRUE(std::ranges::equal(a[i].bytes, b[i].bytes)) << a[i].name;
}

TEST_F(StoredViews, OfAnotherNumberOfViewsAreRefused) {
  capture_.views.pop_back();
  try {
    apply_learned_views(capture_, job_.snapshot);
    FAIL();
  } catch (const SnapshotError& refused) {
    EXPECT_THAT(refused.what(), HasSubstr("learned of 6 views, but the capture has 5"));
  }
}

TEST_F(StoredViews, OfAnotherNumberOfLensesAreRefused) {
  capture_.views[0].intrinsics.fx *= 2;
  EXPECT_THROW((void)apply_learned_views(capture_, job_.snapshot), SnapshotError);
}

TEST_F(StoredViews, TellWhatTheyAreAndNameCamerasThatMustBeWrong) {
  Capture untouched = capture_;
  const std::vector<std::string> lines = apply_learned_views(untouched, job_.snapshot);
  EXPECT_THAT(lines, testing::Contains(HasSubstr("cameras: turned by")));
  EXPECT_THAT(lines, testing::Contains(HasSubstr("lens: focal length times")));
  EXPECT_THAT(lines, testing::Not(testing::Contains(HasSubstr("wrong"))));

  auto model = LuminanceModel::load(job_.snapshot, cpu_engines());
  test::floats_of(model.engine->state(), "views")[kViewNumbers * 3 + 1] = 0.1f;  // the fifth view turned by 6 degrees
  model.engine->state_loaded();
  model.save(job_.snapshot);
  EXPECT_THAT(apply_learned_views(capture_, job_.snapshot),
              testing::Contains(HasSubstr("wrong, by the look of it: toy4")));
}

/// It is not in proportion to all of the boxes around a scene.
TEST_F(StoredViews, NameCamerasThatMovedFarInTheInnermostBox) {
  const auto lines_of = [&](float share) {
    auto model = LuminanceModel::load(job_.snapshot, cpu_engines());
    EXPECT_EQ(model.frame.cascades, 3);
    const float side = 0.25f;                                                              // of the innermost box
    test::floats_of(model.engine->state(), "views")[kViewNumbers * 3 + 4] = share * side;  // of the fifth view
    model.engine->state_loaded();
    model.save(folder_ / "moved.snapshot");
    Capture copy = capture_;
    return apply_learned_views(copy, folder_ / "moved.snapshot");
  };
  EXPECT_THAT(lines_of(0.01f), testing::Not(testing::Contains(HasSubstr("wrong"))));
  EXPECT_THAT(lines_of(0.03f), testing::Contains(HasSubstr("wrong, by the look of it: toy4")));
}

TEST_F(StoredViews, LieBesideOptionsThatHoldTheirNumbers) {
  auto model = LuminanceModel::load(job_.snapshot, cpu_engines());
  const nlohmann::json good = Snapshot(job_.snapshot, "stage1").header();
  for (const auto& [option, number] :
       std::map<std::string, nlohmann::json>{{"samples_per_step", (std::int64_t(1) << 32) + 1024}, {"steps", 0.5}}) {
    nlohmann::json header = good;
    ASSERT_TRUE(header["options"].contains(option));
    header["options"][option] = number;
    save_snapshot(folder_ / "forged.snapshot", "stage1", header, model.engine->state());
    EXPECT_THROW((void)LuminanceModel::load(folder_ / "forged.snapshot", cpu_engines()), SnapshotError) << option;
  }
}

TEST_F(StoredViews, ThatAreForgedAreRefused) {
  const Snapshot good(job_.snapshot, "stage1");
  auto model = LuminanceModel::load(job_.snapshot, cpu_engines());
  for (const nlohmann::json& forged :
       {nlohmann::json(-1), nlohmann::json(1 << 30), nlohmann::json(5), nlohmann::json("6"), nlohmann::json(0),
        nlohmann::json((std::int64_t(1) << 32) + 6)}) {
    nlohmann::json header = good.header();
    header["learned_views"] = forged;
    save_snapshot(folder_ / "forged.snapshot", "stage1", header, model.engine->state());
    EXPECT_THROW((void)LuminanceModel::load(folder_ / "forged.snapshot", cpu_engines()), SnapshotError) << forged;
  }
  for (const nlohmann::json& forged : {nlohmann::json(-1), nlohmann::json(7), nlohmann::json(2), nlohmann::json(0)}) {
    nlohmann::json header = good.header();
    header["learned_lenses"] = forged;
    save_snapshot(folder_ / "forged.snapshot", "stage1", header, model.engine->state());
    EXPECT_THROW((void)LuminanceModel::load(folder_ / "forged.snapshot", cpu_engines()), SnapshotError) << forged;
  }
  std::vector<StatePiece> state = model.engine->state();
  test::floats_of(state, "views")[2] = std::numeric_limits<float>::infinity();
  for (StatePiece& piece : state) piece.holds_floats = false;  // as a program would write that does not look
  save_snapshot(folder_ / "forged.snapshot", "stage1", good.header(), state);
  EXPECT_THROW((void)LuminanceModel::learned_views_in(folder_ / "forged.snapshot"), SnapshotError);
  EXPECT_THROW((void)LuminanceModel::load(folder_ / "forged.snapshot", cpu_engines()), SnapshotError);
}

TEST_F(StoredViews, OfOtherCountersAreRefused) {
  const Snapshot good(job_.snapshot, "stage1");
  auto model = LuminanceModel::load(job_.snapshot, cpu_engines());
  using Counters = std::vector<std::int64_t>;  // steps, rays of the next one
  const std::int64_t many = std::int64_t(1) << 40;
  for (Counters forged : {Counters{5, many}, Counters{5, 0}, Counters{-1, 64}, Counters{many, 64}, Counters{5}}) {
    std::vector<StatePiece> state = model.engine->state();
    for (StatePiece& piece : state) {
      if (piece.name == "counters") piece = state_piece("counters", forged);
    }
    save_snapshot(folder_ / "forged.snapshot", "stage1", good.header(), state);
    EXPECT_THROW((void)LuminanceModel::load(folder_ / "forged.snapshot", cpu_engines()), SnapshotError) << forged[0];
  }
}

TEST_F(StoredViews, AreNotGoneOnWithByOthers) {
  Observer observer;
  job_.resume = true;
  EXPECT_NO_THROW((void)train_stage1(job_, cpu_engines(), observer));
  check_views(job_.snapshot, capture_);
  check_views(folder_ / "nowhere.snapshot", capture_);
  const auto is_refused = [&] {
    EXPECT_THROW((void)train_stage1(job_, cpu_engines(), observer), SnapshotError);
    EXPECT_THROW(check_views(job_.snapshot, capture_), SnapshotError);
  };
  // As many views as before, but others.
  capture_.views[3].held_out = false;
  capture_.views[2].held_out = true;
  is_refused();
  capture_ = clip();
  capture_.views[2].image.transfer = Transfer::kLinear;
  is_refused();
}

TEST_F(StoredViews, OfOtherCamerasAreRefused) {
  Observer observer;
  capture_.cameras = "moved";
  Capture copy = capture_;
  EXPECT_NO_THROW((void)apply_learned_views(copy, job_.snapshot)) << "a snapshot that does not say";
  EXPECT_NO_THROW(check_views(job_.snapshot, capture_));

  capture_.cameras = "given";
  job_.snapshot = folder_ / "given.snapshot";
  train_stage1(job_, cpu_engines(), observer);
  job_.resume = true;
  for (const char* known : {"given", ""}) {
    capture_.cameras = known;
    copy = capture_;
    EXPECT_NO_THROW((void)apply_learned_views(copy, job_.snapshot)) << known;
    EXPECT_NO_THROW(check_views(job_.snapshot, capture_)) << known;
    EXPECT_NO_THROW((void)train_stage1(job_, cpu_engines(), observer)) << known;
  }
  capture_.cameras = "moved";
  EXPECT_THAT([&] { check_views(job_.snapshot, capture_); },
              testing::ThrowsMessage<SnapshotError>(HasSubstr("given.snapshot: was trained with other cameras")));
  EXPECT_THROW((void)train_stage1(job_, cpu_engines(), observer), SnapshotError);
  EXPECT_THROW((void)apply_learned_views(capture_, job_.snapshot), SnapshotError);
}

/// Options say nothing of it, but the engine that goes on has it.
TEST_F(StoredViews, GoOnWithTheOccupancyTheyHave) {
  options_.steps = 48;
  Observer observer;
  {
    auto model = LuminanceModel::load(job_.snapshot, cpu_engines());
    model.options.steps = 48;
    model.save(job_.snapshot);
  }
  options_.occupancy = {};
  job_.resume = true;
  EXPECT_NE(options_.occupancy.resolution, 32);
  train_stage1(job_, cpu_engines(), observer);
  EXPECT_EQ(LuminanceModel::load(job_.snapshot, cpu_engines()).engine->step_count(), 48);
}

/// Cameras moved before the training, in world units.
LearnedViews moves() {
  LearnedViews moved{{{}, 1, 1}, std::vector<ViewCorrection>(6), std::vector<LensCorrection>(1)};
  for (std::size_t v = 0; v < 6; ++v) {
    moved.corrections[v].turn = {0.01f * float(v), -0.02f, 0.03f};
    moved.corrections[v].shift = {0.05f, 0.01f * float(v), -0.02f};
  }
  moved.lenses[0] = {.log_focal = 0.04f, .x = 0.01f, .k1 = 0.02f};
  return moved;
}

TEST_F(StoredViews, FollowWhatWasMovedBefore) {
  Capture adjusted = clip();
  apply_learned_views(adjusted, moves());
  const Stage1Job job{
      .capture = adjusted, .options = options_, .snapshot = folder_ / "moved.snapshot", .moved = moves()};
  Observer silent;
  train_stage1(job, cpu_engines(), silent);
  const auto model = LuminanceModel::load(job.snapshot, cpu_engines());
  // Moved first, then as the engine learned: what the snapshot says leads from what was given to the same cameras.
  apply_learned_views(adjusted, {model.frame, model.engine->view_corrections(), model.engine->lens_corrections()});
  (void)apply_learned_views(capture_, job.snapshot);
  for (std::size_t v = 0; v < capture_.views.size(); ++v) {
    const View &expected = adjusted.views[v], &found = capture_.views[v];
    if (!found.held_out) {
      EXPECT_LT(length(found.world_from_camera.translation - expected.world_from_camera.translation), 1e-6);
      for (int axis = 0; axis < 3; ++axis) {
        const Vec3d off = found.world_from_camera.linear.column(axis) - expected.world_from_camera.linear.column(axis);
        EXPECT_LT(length(off), 1e-6);
      }
    }
    EXPECT_NEAR(found.intrinsics.fx, expected.intrinsics.fx, 1e-4);
    EXPECT_NEAR(found.intrinsics.cx, expected.intrinsics.cx, 1e-4);
    EXPECT_NEAR(found.intrinsics.distortion[0], expected.intrinsics.distortion[0], 1e-7);
    EXPECT_NEAR(found.image.exposure, expected.image.exposure, 1e-6f);
  }
  model.save(folder_ / "again.snapshot");
  EXPECT_EQ(read_binary_file(folder_ / "again.snapshot"), read_binary_file(job.snapshot));
}

TEST_F(StoredViews, ThatWereMovedAndAreForgedAreRefused) {
  auto model = LuminanceModel::load(job_.snapshot, cpu_engines());
  model.moved = moves();
  model.save(job_.snapshot);
  EXPECT_NO_THROW((void)LuminanceModel::learned_views_in(job_.snapshot));
  const Snapshot good(job_.snapshot, "stage1");
  std::vector<StatePiece> state = model.engine->state();
  state.push_back(state_piece("moved.views", model.moved.corrections));
  state.push_back(state_piece("moved.lenses", model.moved.lenses));
  for (const char* field : {"moved_views", "moved_lenses"}) {
    for (const nlohmann::json& forged : {nlohmann::json(-1), nlohmann::json(1 << 30), nlohmann::json(2)}) {
      nlohmann::json header = good.header();
      header[field] = forged;
      save_snapshot(folder_ / "forged.snapshot", "stage1", header, state);
      EXPECT_THROW((void)LuminanceModel::load(folder_ / "forged.snapshot", cpu_engines()), SnapshotError)
          << field << forged;
      EXPECT_THROW((void)LuminanceModel::learned_views_in(folder_ / "forged.snapshot"), SnapshotError)
          << field << forged;
    }
  }
  model.moved.corrections.pop_back();
  model.save(job_.snapshot);
  EXPECT_THROW((void)LuminanceModel::learned_views_in(job_.snapshot), SnapshotError) << "of fewer than are trained on";
}

TEST(LearnedViews, SayHowFarTheyAreFromWhatWasGiven) {
  EXPECT_TRUE(facts_of({}).empty());
  LearnedViews learned;
  learned.corrections = gains({-0.2f, 0, 0.1f});
  const std::vector<LearnedFact> facts = facts_of(learned);
  ASSERT_EQ(facts.size(), 1u) << "poses were not learned";
  EXPECT_EQ(facts[0].text, "0.82 to 1.11 of the median view's");
}

TEST(LearnedViews, SayWhatALensWasAndIs) {
  LearnedViews learned;
  learned.corrections = gains({0, 0});
  learned.lenses.resize(1);
  learned.lenses[0].log_focal = std::log(1.02f);
  learned.lenses[0].x = 0.01f;
  learned.lenses[0].k1 = 0.05f;
  const Intrinsics given = {LensModel::kOpenCv, 640, 480, 500, 500, 320, 240, {0.1, 0, 0, -0.002}};
  const std::vector<LearnedFact> facts = facts_of(learned, std::vector{given});
  ASSERT_EQ(facts.size(), 1u);
  EXPECT_EQ(facts[0].text,
            "focal length times 1.0200 (500.0 -> 510.0 pixels), principal point 320.0, 240.0 -> 325.0, 240.0, "
            "k1 +0.1000 -> +0.1500, k2 +0.0000 -> +0.0000, p1 +0.0000 -> +0.0000, p2 -0.0020 -> -0.0020");
  EXPECT_THAT(facts_of(learned)[0].text, HasSubstr("focal length times 1.0200, k1 +0.0500"));
}

}  // namespace
}  // namespace cnerf
