#pragma once
/// Gradients of several processes that train one field together.

#include <functional>
#include <span>

namespace cnerf {

/// Adds values up over the processes, in place; all get the same bits. Empty where there is one process only.
using GradientSum = std::function<void(std::span<float>)>;

}  // namespace cnerf
