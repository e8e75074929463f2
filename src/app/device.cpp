#include "src/app/device.h"

#include "src/app/version.h"
#include "src/base/error.h"

namespace cnerf {

void check_device(const std::string& device) {
  if (device != "cuda" || has_cuda_engine()) return;
  throw DeviceError("--device cuda: this build has no CUDA engine; pass --device cpu (or auto)");
}

}  // namespace cnerf
