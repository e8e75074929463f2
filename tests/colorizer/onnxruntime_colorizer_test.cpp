// onnx: colorizers by ONNX Runtime; dnn_colorizer_test.cpp asks whichever engine the build has.

#include <cstdio>
#include <filesystem>
#include <vector>

#include "src/base/files.h"
#include "src/colorizer/kinds.h"
#include "tests/colorizer/questions.h"
#include "tests/support/data.h"
#include "tests/support/onnx_model.h"

namespace cnerf {
namespace {

using test::message_of;
using test::some_question;
using ::testing::HasSubstr;
using ::testing::StartsWith;

class OnnxRuntimeColorizer : public ::testing::Test {
 protected:
  std::string model(const test::OnnxInput& input, const std::string& toml = "") {
    write_file(folder_ / "net.onnx", test::onnx_convolution({0.5f, -1}, {3, 20}, input));
    write_file(folder_ / "net.onnx.toml", toml);
    return "onnx:" + (folder_ / "net.onnx").string();
  }
  test::TempDir folder_;
};

TEST_F(OnnxRuntimeColorizer, IsTheEngineOfThisBuild) {
  EXPECT_THAT(onnx_engine(), StartsWith("ONNX Runtime "));
}

TEST_F(OnnxRuntimeColorizer, AnswersAsOpenCvDoes) {
  const std::string spec = model({2, 6, 5});
  ColorizerOptions options;
  options.spec = spec;
  const ChromaBatch ours = test::colorizer_of(spec)->colorize(some_question());
  const ChromaBatch opencv = make_onnx_colorizer({spec.substr(5), options, {}})->colorize(some_question());
  ASSERT_EQ(ours.ab.size(), opencv.ab.size());
  for (std::size_t i = 0; i < ours.ab.size(); ++i) EXPECT_NEAR(ours.ab[i], opencv.ab[i], 1e-4);
}

TEST_F(OnnxRuntimeColorizer, ANetworkForABatchOfOneIsAskedSingly) {
  const LightnessBatch question = some_question(3);
  const ChromaBatch answer = test::colorizer_of(model({1, 6, 5}))->colorize(question);
  ASSERT_EQ(answer.batch, 3);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(ab_of(answer, i)[4], 0.5f * question.lightness[std::size_t(30 * i + 4)] + 3, 1e-4);
  }
}

TEST_F(OnnxRuntimeColorizer, OpeningANetworkPrintsNothing) {
  const std::string spec = model({2, 6, 5});
  testing::internal::CaptureStderr();
  (void)test::colorizer_of(spec);
  std::fputs("after", stderr);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "after");
}

TEST_F(OnnxRuntimeColorizer, OutputsAreChosenByName) {
  EXPECT_NO_THROW((void)test::colorizer_of(model({2, 6, 5}, "layer = \"y\"\n"))->colorize(some_question()));
  EXPECT_THAT(message_of<ColorizerError>([&] {
                (void)test::colorizer_of(model({2, 6, 5}, "layer = \"ab\"\n"));
              }),
              HasSubstr("no output 'ab'; there are: y"));
}

TEST_F(OnnxRuntimeColorizer, AnotherSizeThanTheNetworksIsRefusedWithIt) {
  const auto colorizer = test::colorizer_of(model({2, 7, 5}));
  EXPECT_THAT(message_of<ColorizerError>([&] { (void)colorizer->colorize(some_question()); }),
              HasSubstr("failed on an input of [2, 1, 6, 5]"));
}

}  // namespace
}  // namespace cnerf
