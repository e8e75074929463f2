#include "src/colorizer/torch/torch_threads.h"

#include <ATen/Parallel.h>

#include <algorithm>

#include "src/base/parallel.h"

// Present when LibTorch computes with OpenBLAS, null otherwise.
extern "C" __attribute__((weak)) void openblas_set_num_threads(int threads);
extern "C" __attribute__((weak)) int openblas_get_num_threads();

namespace cnerf {
namespace {

/// 0: LibTorch computes with something else.
int blas_threads() {
  return openblas_get_num_threads == nullptr ? 0 : openblas_get_num_threads();
}

}  // namespace

void limit_torch_threads() {
  static const int torch_began = at::get_num_threads(), blas_began = blas_threads();
  at::set_num_threads(std::min(torch_began, thread_count()));
  if (blas_began > 0) openblas_set_num_threads(std::min(blas_began, thread_count()));
}

SingleThreadedOps::SingleThreadedOps() : torch_before_(at::get_num_threads()), blas_before_(blas_threads()) {
  at::set_num_threads(1);
  if (blas_before_ > 0) openblas_set_num_threads(1);
}

SingleThreadedOps::~SingleThreadedOps() {
  at::set_num_threads(torch_before_);
  if (blas_before_ > 0) openblas_set_num_threads(blas_before_);
}

}  // namespace cnerf
