#pragma once
/// Gradients of several processes that train one field together.

#include <cstddef>
#include <functional>
#include <span>

namespace cnerf {

/// Adds values up over the processes, in place; all get the same bits. Empty where there is one process only.
using GradientSum = std::function<void(std::span<float>)>;

/// The same of values in a GPU's memory. The sum is work of a stream: the call does not wait for it.
/// @param stream  a cudaStream_t
using DeviceGradientSum = std::function<void(float* values, std::size_t count, void* stream)>;

}  // namespace cnerf
