// onnx: and caffe: colorizers written here: an ONNX file byte by byte, a Caffe description without weights.

#include <cstring>
#include <filesystem>

#include "src/base/files.h"
#include "tests/colorizer/questions.h"
#include "tests/support/data.h"
#include "tests/support/onnx_model.h"

namespace cnerf {
namespace {

using test::message_of;
using test::some_question;
using ::testing::HasSubstr;

/// An ONNX model for some_question(): channel c answers weight[c] L + bias[c].
std::string convolution(const std::vector<float>& weights, const std::vector<float>& biases) {
  return test::onnx_convolution(weights, biases, {2, 6, 5});
}

class DnnColorizer : public ::testing::Test {
 protected:
  std::string file(const std::string& name, const std::string& content, const std::string& toml = "") {
    write_file(folder_ / name, content);
    if (!toml.empty()) write_file((folder_ / name).string() + ".toml", toml);
    return (folder_ / name).string();
  }
  test::TempDir folder_;
};

TEST_F(DnnColorizer, OnnxAnswersAbInItsDeclaredUnits) {
  const LightnessBatch question = some_question();
  const auto plain = test::colorizer_of("onnx:" + file("a.onnx", convolution({0.5f, -1}, {3, 20})));
  const ChromaBatch answer = plain->colorize(question);
  EXPECT_NEAR(ab_of(answer, 1)[4], 0.5f * question.lightness[34] + 3, 1e-4);
  EXPECT_NEAR(ab_of(answer, 1)[34], -question.lightness[34] + 20, 1e-4);

  const auto scaled = test::colorizer_of(
      "onnx:" + file("b.onnx", convolution({0.5f, -1}, {0, 0}), "input = \"L01\"\noutput = \"ab1\"\n"));
  EXPECT_NEAR(ab_of(scaled->colorize(question), 0)[7], 0.5f * question.lightness[7] / 100 * 110, 1e-4);
}

TEST_F(DnnColorizer, AnOnnxFileThatIsCutShortOrOfAnotherShapeIsRefused) {
  const std::string good = convolution({1, 1}, {0, 0});
  EXPECT_THAT(message_of<ColorizerError>(
                  [&] { (void)test::colorizer_of("onnx:" + file("cut.onnx", good.substr(0, good.size() / 2))); }),
              HasSubstr("opset"));
  EXPECT_THAT(message_of<ColorizerError>([&] {
                (void)test::colorizer_of("onnx:" + file("three.onnx", convolution({1, 1, 1}, {0, 0, 0})))
                    ->colorize(some_question());
              }),
              HasSubstr("[2, 3, 6, 5]"));
  EXPECT_THAT(
      message_of<ColorizerError>([&] {
        const float none = std::numeric_limits<float>::quiet_NaN();
        (void)test::colorizer_of("onnx:" + file("nan.onnx", convolution({1, 1}, {0, none})))->colorize(some_question());
      }),
      HasSubstr("nan"));
  EXPECT_THAT(message_of<MissingInputError>([&] { (void)test::colorizer_of("onnx:/nowhere/net.onnx"); }),
              HasSubstr("/nowhere/net.onnx"));
  EXPECT_THAT(
      message_of<InputError>([&] { (void)test::colorizer_of("onnx:" + file("key.onnx", good, "inputs = \"L01\"\n")); }),
      HasSubstr("inputs"));
}

constexpr const char* kCaffe = R"(
name: "shift"
input: "data"
input_dim: 2 input_dim: 1 input_dim: 6 input_dim: 5
layer { name: "a" type: "Power" bottom: "data" top: "a" power_param { power: 1 scale: 1 shift: -50 } }
layer { name: "b" type: "Power" bottom: "data" top: "b" power_param { power: 1 scale: -1 shift: 0 } }
layer { name: "ab" type: "Concat" bottom: "a" bottom: "b" top: "ab" concat_param { axis: 1 } }
layer { name: "late" type: "Power" bottom: "a" top: "late" power_param { power: 1 scale: 1 shift: 0 } }
)";

TEST_F(DnnColorizer, CaffeIsReadWithItsLayerNamed) {
  const std::string weights =
      file("net.caffemodel", test::ProtobufMessage().bytes(1, "shift").text(), "layer = \"ab\"\n");
  const auto colorizer = test::colorizer_of("caffe:" + file("net.prototxt", kCaffe) + "," + weights);
  const LightnessBatch question = some_question();
  const std::vector<float> ab = ab_of(colorizer->colorize(question), 1);
  EXPECT_NEAR(ab[3], question.lightness[33] - 50, 1e-4);
  EXPECT_NEAR(ab[33], -question.lightness[33], 1e-4);
}

TEST_F(DnnColorizer, CaffeNeedsBothFiles) {
  const std::string description = file("net.prototxt", kCaffe);
  EXPECT_THAT(message_of<UsageError>([&] { (void)test::colorizer_of("caffe:" + description); }),
              HasSubstr("PROTO,MODEL"));
  EXPECT_THAT(message_of<ColorizerError>([&] {
                (void)test::colorizer_of("caffe:" + file("bad.prototxt", "layer { nonsense") + "," +
                                         file("w.caffemodel", test::ProtobufMessage().bytes(1, "shift").text()));
              }),
              HasSubstr("in this order"));
}

}  // namespace
}  // namespace cnerf
