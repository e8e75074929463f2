#pragma once
/// The device a command was asked to use.

#include <string>

namespace cnerf {

/// @param device  "auto", "cpu" or "cuda".
/// @throws DeviceError  for "cuda" where this build or this machine has none.
void check_device(const std::string& device);

}  // namespace cnerf
