/// Snapshots name the kernels that trained them.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "src/engine/engines.h"
#include "src/train/luminance/luminance_model.h"
#include "src/train/luminance/stage1.h"
#include "tests/support/data.h"
#include "tests/support/isa.h"
#include "tests/support/toy_capture.h"

namespace cnerf {
namespace {
using testing::AllOf;
using testing::HasSubstr;

struct Listening final : Observer {
  void say(const std::string& text) override { said += text + "\n"; }
  std::string said;
};

Stage1Options few_steps() {
  Stage1Options options;
  options.grid.levels = 4;
  options.grid.log2_rows = 12;
  options.steps = 10;
  options.samples_per_step = 1 << 12;
  return options;
}

TEST(Kernels, GoingOnWithOthersIsSaid) {
  const test::TempDir folder;
  const Capture capture = test::toy_capture();
  const Stage1Options options = few_steps();
  const auto file = folder / "stage1.snapshot";
  const auto heard = [&](IsaLevel isa, bool resume) {
    const test::ScopedIsa scope(isa);
    Listening observer;
    (void)train_stage1({capture, options, file, resume}, cpu_engines(), observer);
    return observer.said;
  };
  EXPECT_EQ(heard(IsaLevel::kGeneric, false), "");
  EXPECT_EQ(heard(IsaLevel::kGeneric, true), "");
  EXPECT_EQ(LuminanceModel::load(file, cpu_engines()).kernels_before, "generic");
  if (detected_isa() < IsaLevel::kAvx2) GTEST_SKIP() << "this processor has one kind of kernels";
  EXPECT_THAT(heard(IsaLevel::kAvx2, true), AllOf(HasSubstr("stage1.snapshot"), HasSubstr("generic"), HasSubstr("avx2"),
                                                  HasSubstr("kernels=generic")));
}

}  // namespace
}  // namespace cnerf
