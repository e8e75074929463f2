#pragma once
/// The device that bakes. Set once by the application.

#include "src/engine/engines.h"

namespace cnerf {

void select_engine_device(Device device);
[[nodiscard]] Device engine_device();

}  // namespace cnerf
