// A capture of a comparison with one seed: what its stage 1 is told, and what its cells remember.

#include "src/compare/seed_run.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "src/base/files.h"
#include "src/colorizer/picture_encoder.h"
#include "src/compare/derived_engines.h"
#include "src/pipeline/run_context.h"
#include "src/sample/sample_scene.h"
#include "tests/evaluate/analytic_engine.h"
#include "tests/support/data.h"
#include "tests/support/tiny_config.h"

namespace cnerf::compare {
namespace fs = std::filesystem;
namespace {

/// Engines whose fields keep how much memory photographs may take, and cannot train.
class KeepingEngines final : public DerivedEngines {
 public:
  using DerivedEngines::DerivedEngines;
  [[nodiscard]] std::unique_ptr<LuminanceEngine> make_luminance(const LuminanceEngineOptions&) const override {
    struct Keeping final : test::AnalyticEngine {
      explicit Keeping(std::size_t& kept) : memory(kept) {}
      void limit_image_memory(std::size_t bytes) override { memory = bytes; }
      void exclude(const std::function<bool(Vec3f, float)>&) override {}
      std::size_t& memory;
    };
    return std::make_unique<Keeping>(memory);
  }
  mutable std::size_t memory = 0;
};

/// An encoder that is installed.
struct Encoding final : PictureEncoder {
  [[nodiscard]] std::vector<float> regions(std::span<const std::uint8_t>, int, int) const override { return {}; }
};

class SeedRunTest : public testing::Test {
 protected:
  SeedRunTest() {
    write_sample_scene(folder_ / "capture", {.views = 9, .width = 48, .height = 36, .samples_per_pixel = 1});
    config_.image_memory = "64M";
    config_.colorizer.spec = "grey";
    config_.stage1.free_space = false;
    config_.stage1.depth_weight = 0;
    subjects_ = read_subjects({{folder_ / "capture"}}, config_, observer_, folder_.path());
  }
  [[nodiscard]] SeedRun seed_run() const { return {bench_, *subjects_.front(), 1, folder_ / "seed-1"}; }
  /// Of a cell, which remembers them though it fails: there is no stage 1.
  [[nodiscard]] std::string settings() const {
    SeedRun run = seed_run();
    EXPECT_THROW(run.train(), std::logic_error);
    run.color(grey_);
    return run.judge(grey_).settings;
  }

  const Method& grey_ = *parse_methods("grey").front();
  test::TempDir folder_;
  Config config_ = test::tiny_config();
  Observer observer_;
  Plan plan_;
  KeepingEngines engines_{cpu_engines()};
  Encoding encoder_;
  Bench bench_{plan_, config_, engines_, nullptr, &encoder_, observer_};
  std::vector<std::unique_ptr<const Subject>> subjects_;
};

TEST_F(SeedRunTest, PhotographsTakeTheMemoryThatTheUserGivesThem) {
  EXPECT_THROW(seed_run().train(), std::logic_error);
  EXPECT_EQ(engines_.memory, pipeline::image_memory(config_));
}

TEST_F(SeedRunTest, WhatWasTrainedIsJudgedLaterAndByOthers) {
  SeedRun trains = seed_run();
  EXPECT_THROW(trains.train(), std::logic_error);
  trains.color(grey_);
  EXPECT_TRUE(fs::exists(folder_ / "seed-1/grey/colored.json"));
  const Cell cell = seed_run().judge(grey_);
  EXPECT_NE(cell.error, "") << "there is no stage 1";
  EXPECT_FALSE(fs::exists(folder_ / "seed-1/grey/colored.json"));
  EXPECT_EQ(seed_run().judge(grey_).error, cell.error) << "read";
  trains.color(grey_);
  EXPECT_TRUE(fs::exists(folder_ / "seed-1/grey/colored.json")) << "what failed is made again";
}

TEST_F(SeedRunTest, AnotherEncoderMakesOtherCells) {
  ::setenv("CNERF_ENCODER", (folder_ / "encoder").c_str(), 1);
  write_file(folder_ / "encoder/model.json", std::string("one"));
  const std::string first = settings();
  EXPECT_EQ(settings(), first);
  write_file(folder_ / "encoder/model.json", std::string("other"));
  EXPECT_NE(settings(), first);
  ::unsetenv("CNERF_ENCODER");
}

TEST_F(SeedRunTest, OtherWeightsOfLpipsMakeOtherCells) {
  CNERF_REQUIRE_DATA(weights, "lpips/lpips_alex_f32.bin");
  const Lpips lpips(weights);
  bench_.lpips = &lpips;
  plan_.lpips_weights = folder_ / "weights.bin";
  write_file(plan_.lpips_weights, std::string("one"));
  const std::string first = settings();
  write_file(plan_.lpips_weights, std::string("other"));
  EXPECT_NE(settings(), first);
}

}  // namespace
}  // namespace cnerf::compare
