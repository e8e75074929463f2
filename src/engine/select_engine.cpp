#include "src/engine/select_engine.h"

#include <atomic>

namespace cnerf {
namespace {

std::atomic<Device> selected = Device::kCpu;  // NOLINT: a setting of the process, like its threads

}  // namespace

void select_engine_device(Device device) {
  selected = device;
}
Device engine_device() {
  return selected;
}

}  // namespace cnerf
