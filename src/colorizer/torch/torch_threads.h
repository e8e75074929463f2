#pragma once
/// Threads of Torch's operators.

namespace cnerf {

/// From now on operators and OpenBLAS use at most `thread_count()` threads, and no more than they began with, which is
/// all cores or what the environment allows (OMP_NUM_THREADS).
void limit_torch_threads();

/// One thread inside an operator while it lives: the parallel tasks around it are the parallelism, and a sum's order
/// must not depend on the machine. OpenBLAS has threads of its own, which would spin beside ours. Tasks call
/// `at::init_num_threads()` first, since the number is kept a thread.
class SingleThreadedOps {
 public:
  SingleThreadedOps();
  ~SingleThreadedOps();
  SingleThreadedOps(const SingleThreadedOps&) = delete;
  SingleThreadedOps& operator=(const SingleThreadedOps&) = delete;

 private:
  int torch_before_, blas_before_;
};

}  // namespace cnerf
