// onnx: colorizers by ONNX Runtime; dnn_colorizer_test.cpp asks whichever engine the build has.

#include <sys/resource.h>

#include <algorithm>
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

/// The library makes constants as it opens a network: four gigabytes of a few bytes.
TEST_F(OnnxRuntimeColorizer, ANetworkThatSwellsAsItIsOpenedIsRefused) {
  using Message = test::ProtobufMessage;
  const auto node = [](const char* type, const std::vector<const char*>& inputs, const char* output) {
    Message message;
    for (const char* input : inputs) message.bytes(1, input);
    return message.bytes(2, output).bytes(4, type);
  };
  const auto value = [](const char* name) {
    Message sides;
    for (const int side : {2, 1, 6, 5}) sides.message(1, Message().number(1, std::uint64_t(side)));
    return Message().bytes(1, name).message(2, Message().message(1, Message().number(1, 1).message(2, sides)));
  };
  const Message sides = Message().number(1, 2).number(2, 7).bytes(8, "sides").number(7, 32768).number(7, 32768);
  Message graph;
  graph.message(1, node("ConstantOfShape", {"sides"}, "zeros")).message(1, node("ReduceMax", {"zeros"}, "zero"));
  graph.message(1, node("Add", {"x", "zero"}, "y")).bytes(2, "g").message(5, sides);
  graph.message(11, value("x")).message(12, value("y"));
  write_file(folder_ / "net.onnx", Message().number(1, 7).message(7, graph).message(8, Message().number(2, 13)).text());
  EXPECT_THROW((void)test::colorizer_of("onnx:" + (folder_ / "net.onnx").string()), ColorizerError);
  rusage own{}, children{};
  ::getrusage(RUSAGE_SELF, &own);
  ::getrusage(RUSAGE_CHILDREN, &children);
  EXPECT_LT(std::max(own.ru_maxrss, children.ru_maxrss), 1L << 20) << "KiB";
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
