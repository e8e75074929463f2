#include "src/engine/color_engines.h"

#include "src/base/error.h"

namespace cnerf {
namespace {

void refuse_share(const StepShare& share) {
  if (!share.is_whole()) throw DeviceError("this device's engines do not share a step with other processes");
}

}  // namespace

void ColorBinEngine::share_steps(const StepShare& share) {
  refuse_share(share);
}

void ColorFieldEngine::share_steps(const StepShare& share) {
  refuse_share(share);
}

}  // namespace cnerf
