#pragma once
/// What an ONNX file says of its tensors, checked before a library believes it.

#include <string>
#include <string_view>

namespace cnerf {

/// OpenCV reads as many numbers of a tensor as its shape has, whether the file holds them or not (4.6 and 4.10).
/// @param model  bytes of a ModelProto (https://github.com/onnx/onnx/blob/main/onnx/onnx.proto)
/// @return what is wrong: a tensor with fewer numbers than it states, or that the bytes are no such message; empty
/// where
///         nothing is
[[nodiscard]] std::string fault_of_onnx(std::string_view model);

}  // namespace cnerf
