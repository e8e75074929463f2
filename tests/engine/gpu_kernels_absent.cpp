#include "src/base/error.h"
#include "tests/engine/gpu_kernels.h"

namespace cnerf::test {

std::vector<float> gpu_encode(const std::vector<GridLevel>&, const std::vector<float>&, const std::vector<float>&) {
  throw DeviceError("this build has no CUDA engine");
}
std::vector<float> gpu_encode_backward(const std::vector<GridLevel>&, const std::vector<float>&,
                                       const std::vector<float>&) {
  throw DeviceError("this build has no CUDA engine");
}
void gpu_update_rows(RowProblem&) {
  throw DeviceError("this build has no CUDA engine");
}

}  // namespace cnerf::test
