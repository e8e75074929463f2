#pragma once
/// Models in ONNX, written byte by byte: tests need no other library for them.

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace cnerf::test {

/// A message in the wire format of protocol buffers.
class ProtobufMessage {
 public:
  ProtobufMessage& number(int field, std::uint64_t value) {
    varint(std::uint64_t(field) << 3);
    varint(value);
    return *this;
  }
  ProtobufMessage& bytes(int field, const std::string& value) {
    varint((std::uint64_t(field) << 3) | 2);
    varint(value.size());
    text_ += value;
    return *this;
  }
  ProtobufMessage& message(int field, const ProtobufMessage& value) { return bytes(field, value.text_); }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  void varint(std::uint64_t value) {
    for (; value >= 128; value >>= 7) text_ += char((value & 127) | 128);
    text_ += char(value);
  }
  std::string text_;
};

/// A batch of pictures of one channel: what a model is asked.
struct OnnxInput {
  int batch = 0, height = 0, width = 0;
};

/// An ONNX model of one 1x1 convolution: channel c answers weight[c] L + bias[c].
[[nodiscard]] inline std::string onnx_convolution(const std::vector<float>& weights, const std::vector<float>& biases,
                                                  const OnnxInput& input) {
  using Message = ProtobufMessage;
  const auto tensor = [](const std::string& name, const std::vector<int>& shape, const std::vector<float>& values) {
    Message out;
    for (const int size : shape) out.number(1, std::uint64_t(size));
    std::string raw(values.size() * sizeof(float), '\0');
    std::memcpy(raw.data(), values.data(), raw.size());
    return out.number(2, 1).bytes(8, name).bytes(9, raw);
  };
  const auto value_info = [](const std::string& name, const std::vector<int>& shape) {
    Message sizes;
    for (const int size : shape) sizes.message(1, Message().number(1, std::uint64_t(size)));
    return Message().bytes(1, name).message(2, Message().message(1, Message().number(1, 1).message(2, sizes)));
  };
  const int channels = int(weights.size());
  const Message kernel = Message().bytes(1, "kernel_shape").number(8, 1).number(8, 1).number(20, 7);
  Message node = Message().bytes(1, "x").bytes(1, "w").bytes(1, "b").bytes(2, "y");
  node.bytes(3, "conv").bytes(4, "Conv").message(5, kernel);
  const Message graph = Message()
                            .message(1, node)
                            .bytes(2, "g")
                            .message(5, tensor("w", {channels, 1, 1, 1}, weights))
                            .message(5, tensor("b", {channels}, biases))
                            .message(11, value_info("x", {input.batch, 1, input.height, input.width}))
                            .message(12, value_info("y", {input.batch, channels, input.height, input.width}));
  return Message().number(1, 7).message(7, graph).message(8, Message().bytes(1, "").number(2, 11)).text();
}

}  // namespace cnerf::test
