#include "bake/visibility/select_views.h"

#include <string>

#include "src/base/error.h"
#if CNERF_CUDA_BAKE
#include "bake/visibility/cuda/view_selection_cuda.h"
#endif

namespace cnerf::bake {

std::unique_ptr<ViewSelection> select_views(const std::vector<Camera>& cameras, std::vector<DensityLevel> levels,
                                            const Options& options, [[maybe_unused]] const Engines& engines,
                                            [[maybe_unused]] Observer& observer) {
#if CNERF_CUDA_BAKE
  if (engines.device() == Device::kCuda) {
    try {
      return std::make_unique<ViewSelectionCuda>(cameras, levels, options);
    } catch (const DeviceError& failure) {
      observer.say(std::string("bake: the processor works out which cameras see what, which is slower: ") +
                   failure.what());
    }
  }
#endif
  return std::make_unique<ViewSelection>(cameras, std::move(levels), options);
}

}  // namespace cnerf::bake
