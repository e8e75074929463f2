#include "src/engine/luminance_engine.h"

#include "src/base/parallel.h"

namespace cnerf {

void LuminanceEngine::render_view(const UnitCamera& camera, const MarchSettings& march, const RenderEffort& effort,
                                  std::span<RayResult> results) const {
  std::vector<Ray> rays(results.size());
  parallel_ranges(rays.size(), 512, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) rays[p] = camera.ray_of_pixel(p);
  });
  render(rays, march, effort, results);
}

}  // namespace cnerf
