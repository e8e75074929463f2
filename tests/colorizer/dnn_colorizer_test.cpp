// onnx: and caffe: colorizers written here: an ONNX file byte by byte, a Caffe description without weights.

#include <cstring>
#include <filesystem>

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

TEST_F(DnnColorizer, NamesTellNetworksAndTheirContractsApart) {
  const auto name_of = [&](float weight, const std::string& toml) {
    return test::colorizer_of("onnx:" + file("net.onnx", convolution({weight, 1}, {0, 0}), toml))->name();
  };
  const std::string name = name_of(1, "");
  EXPECT_THAT(name, ::testing::MatchesRegex("onnx:.*/net\\.onnx \\([0-9a-f]{8}\\)"));
  EXPECT_EQ(name_of(1, ""), name);
  EXPECT_NE(name_of(2, ""), name);
  EXPECT_NE(name_of(1, "input = \"L01\"\n"), name);
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

// OpenCV would read on behind the file's numbers; it is asked whichever engine the build has.
TEST_F(DnnColorizer, AnOnnxTensorOfFewerNumbersThanItsShapeIsRefused) {
  const auto refusal = [&](const std::string& content) {
    return message_of<ColorizerError>([&] { (void)make_onnx_colorizer({file("short.onnx", content), {}, {}}); });
  };
  using Message = test::ProtobufMessage;
  const auto model = [](const Message& tensor) {
    return Message().message(7, Message().message(5, tensor).bytes(2, "g")).text();
  };
  const auto bytes = [](std::size_t count) { return std::string(count, '\1'); };
  const auto shape = [](std::uint64_t type) {
    return Message().number(1, 3).number(1, 2).number(2, type).bytes(8, "w");
  };
  EXPECT_THAT(refusal(model(shape(1).bytes(9, bytes(23)))), HasSubstr("\"w\" states 6 numbers and holds 5"));
  EXPECT_THAT(refusal(model(shape(1).bytes(4, bytes(20)))), HasSubstr("holds 5"));    // floats
  EXPECT_THAT(refusal(model(shape(7).bytes(7, bytes(5)))), HasSubstr("holds 5"));     // 64 bits, a byte each
  EXPECT_THAT(refusal(model(shape(11).bytes(10, bytes(47)))), HasSubstr("holds 5"));  // doubles
  EXPECT_THAT(refusal(model(shape(10).bytes(9, bytes(11)))), HasSubstr("holds 5"));   // halves
  // Numbers of another type are not read, and a list of sides may be one field.
  EXPECT_THAT(refusal(model(shape(1).bytes(7, bytes(6)))), HasSubstr("holds 0"));
  EXPECT_THAT(refusal(model(Message().bytes(1, "\x03\x02").number(2, 1).bytes(9, bytes(20)))), HasSubstr("holds 5"));
  EXPECT_THAT(refusal(model(Message().number(1, ~std::uint64_t(0)).number(2, 1).bytes(9, bytes(4)))),
              HasSubstr("side"));

  // In an attribute of a node of a graph of an attribute, and where two halves would be put together.
  const Message deep = Message().message(
      5, Message().message(
             6, Message().message(1, Message().message(5, Message().message(5, shape(1).bytes(9, "1234"))))));
  EXPECT_THAT(refusal(Message().message(7, Message().message(1, deep)).text()), HasSubstr("holds 1"));
  const Message whole = Message().number(1, 1).number(2, 1).bytes(9, "1234");
  const Message twice = Message().message(5, Message().message(5, whole).message(5, whole));
  EXPECT_THAT(refusal(Message().message(7, Message().message(1, twice)).text()), HasSubstr("damaged"));

  std::string nested;
  for (int i = 0; i < 100; ++i) {
    nested = Message().bytes(1, Message().bytes(5, Message().bytes(6, nested).text()).text()).text();
  }
  EXPECT_THAT(refusal(Message().bytes(7, nested).text()), HasSubstr("nest deeper"));
}

TEST_F(DnnColorizer, AnOnnxFileWithAnyByteChangedIsTakenOrRefused) {
  const std::string good = convolution({1, 1}, {0, 0});
  int refused = 0;
  for (std::size_t at = 0; at < good.size(); ++at) {
    std::string changed = good;
    changed[at] = "\x00\x7F\xFF"[at % 3];
    try {
      (void)test::colorizer_of("onnx:" + file("changed.onnx", changed));
    } catch (const ColorizerError&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, int(good.size()) / 4);
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
