/// Snapshots name the kernels that trained them.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "src/engine/engines.h"
#include "src/train/luminance/luminance_model.h"
#include "src/train/luminance/stage1.h"
#include "tests/support/data.h"
#include "tests/support/isa.h"
#include "tests/support/toy_capture.h"
#include "tests/train/few_steps.h"

namespace cnerf {
namespace {
using testing::AllOf;
using testing::HasSubstr;

struct Listening final : Observer {
  void say(const std::string& text) override { said += text + "\n"; }
  std::string said;
};

TEST(Kernels, GoingOnWithOthersIsSaid) {
  const test::TempDir folder;
  const Capture capture = test::toy_capture();
  const Stage1Options options = test::few_steps(10);
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
