/// Numbers that are not finite: training stops and keeps its last snapshot, and nobody reads one that holds them.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/engine/engines.h"
#include "src/train/luminance/luminance_model.h"
#include "src/train/luminance/snapshot.h"
#include "src/train/luminance/stage1.h"
#include "tests/support/data.h"
#include "tests/support/engine_state.h"
#include "tests/support/toy_capture.h"
#include "tests/train/few_steps.h"

namespace cnerf {
namespace {
using testing::AllOf;
using testing::HasSubstr;

Stage1Options steps_with_checkpoints() {
  Stage1Options options = test::few_steps(30);
  options.checkpoint_every = 10;
  return options;
}

std::string message_of(const std::function<void()>& body) {
  try {
    body();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kDiverged) << error.what();
    return error.what();
  }
  ADD_FAILURE() << "threw nothing";
  return "";
}

TEST(Divergence, TrainingNamesStepAndViewAndKeepsTheLastSnapshot) {
  const test::TempDir folder;
  Capture capture = test::toy_capture();
  Stage1Options options = steps_with_checkpoints();
  Observer silent;
  const Stage1Job good{capture, options, folder / "stage1.snapshot"};
  (void)train_stage1(good, cpu_engines(), silent);
  const std::string before = sha256_of_file(good.snapshot);

  MonoImage& broken = capture.views[2].image;
  broken.depth = PixelDepth::kF32;
  broken.f32.assign(broken.pixel_count(), std::numeric_limits<float>::quiet_NaN());
  EXPECT_THAT(message_of([&] {
                (void)train_stage1({capture, options, good.snapshot}, cpu_engines(), silent);
              }),
              AllOf(HasSubstr("at step"), HasSubstr("toy2"), HasSubstr("is kept")));
  EXPECT_EQ(sha256_of_file(good.snapshot), before);
}

TEST(Divergence, ParametersThatAreNotFiniteAreNotSavedOverGoodOnes) {
  const test::TempDir folder;
  LuminanceModel model = LuminanceModel::create(test::toy_capture(), steps_with_checkpoints(), cpu_engines());
  const auto file = folder / "stage1.snapshot";
  model.save(file);
  const std::string before = sha256_of_file(file);
  test::floats_of(model.engine->state(), "density_net.weights")[3] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(message_of([&] { model.save(file); }),
              AllOf(HasSubstr("stage1.snapshot"), HasSubstr("density_net.weights")));
  EXPECT_EQ(sha256_of_file(file), before);
}

TEST(Divergence, SnapshotsThatHoldThemAreRefused) {
  const test::TempDir folder;
  std::vector<float> values = {1, std::numeric_limits<float>::infinity()};
  StatePiece unseen = state_piece("table", values);
  unseen.holds_floats = false;  // as a program would write that does not look
  save_snapshot(folder / "a.snapshot", "test", {}, {unseen});
  const Snapshot snapshot(folder / "a.snapshot", "test");
  EXPECT_THROW(snapshot.restore({state_piece("table", values)}), SnapshotError);
}

}  // namespace
}  // namespace cnerf
