#include "src/colorizer/torch/single_threaded_ops.h"

#include <ATen/Parallel.h>

// Present when LibTorch computes with OpenBLAS, null otherwise.
extern "C" __attribute__((weak)) void openblas_set_num_threads(int threads);
extern "C" __attribute__((weak)) int openblas_get_num_threads();

namespace cnerf {

SingleThreadedOps::SingleThreadedOps() : torch_before_(at::get_num_threads()) {
  at::set_num_threads(1);
  if (openblas_get_num_threads == nullptr || openblas_set_num_threads == nullptr) return;
  blas_before_ = openblas_get_num_threads();
  openblas_set_num_threads(1);
}

SingleThreadedOps::~SingleThreadedOps() {
  at::set_num_threads(torch_before_);
  if (blas_before_ > 0) openblas_set_num_threads(blas_before_);
}

}  // namespace cnerf
