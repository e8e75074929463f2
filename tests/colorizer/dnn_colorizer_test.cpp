// onnx: and caffe: colorizers written here: an ONNX file byte by byte, a Caffe description without weights.

#include <cstring>
#include <filesystem>

#include "src/base/files.h"
#include "tests/colorizer/questions.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

using test::message_of;
using test::some_question;
using ::testing::HasSubstr;

/// A message in the wire format of protocol buffers.
class Message {
 public:
  Message& number(int field, std::uint64_t value) {
    varint(std::uint64_t(field) << 3);
    varint(value);
    return *this;
  }
  Message& bytes(int field, const std::string& value) {
    varint((std::uint64_t(field) << 3) | 2);
    varint(value.size());
    text_ += value;
    return *this;
  }
  Message& message(int field, const Message& value) { return bytes(field, value.text_); }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  void varint(std::uint64_t value) {
    for (; value >= 128; value >>= 7) text_ += char((value & 127) | 128);
    text_ += char(value);
  }
  std::string text_;
};

Message tensor(const std::string& name, const std::vector<int>& shape, const std::vector<float>& values) {
  Message out;
  for (const int size : shape) out.number(1, std::uint64_t(size));
  std::string raw(values.size() * sizeof(float), '\0');
  std::memcpy(raw.data(), values.data(), raw.size());
  return out.number(2, 1).bytes(8, name).bytes(9, raw);
}

Message value_info(const std::string& name, const std::vector<int>& shape) {
  Message sizes;
  for (const int size : shape) sizes.message(1, Message().number(1, std::uint64_t(size)));
  return Message().bytes(1, name).message(2, Message().message(1, Message().number(1, 1).message(2, sizes)));
}

/// An ONNX model of one 1x1 convolution: channel c answers weight[c] L + bias[c].
std::string convolution(const std::vector<float>& weights, const std::vector<float>& biases) {
  const int out = int(weights.size());
  const Message kernel = Message().bytes(1, "kernel_shape").number(8, 1).number(8, 1).number(20, 7);
  const Message node =
      Message().bytes(1, "x").bytes(1, "w").bytes(1, "b").bytes(2, "y").bytes(3, "conv").bytes(4, "Conv").message(
          5, kernel);
  const Message graph = Message()
                            .message(1, node)
                            .bytes(2, "g")
                            .message(5, tensor("w", {out, 1, 1, 1}, weights))
                            .message(5, tensor("b", {out}, biases))
                            .message(11, value_info("x", {2, 1, 6, 5}))
                            .message(12, value_info("y", {2, out, 6, 5}));
  return Message().number(1, 7).message(7, graph).message(8, Message().bytes(1, "").number(2, 11)).text();
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
  const std::string weights = file("net.caffemodel", Message().bytes(1, "shift").text(), "layer = \"ab\"\n");
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
                                         file("w.caffemodel", Message().bytes(1, "shift").text()));
              }),
              HasSubstr("in this order"));
}

}  // namespace
}  // namespace cnerf
