#include "bake/bake_camera.h"

#include "src/capture/capture.h"

namespace cnerf {

std::vector<BakeCamera> cameras_of(const Capture& capture) {
  std::vector<BakeCamera> cameras;
  for (const View& view : capture.views) cameras.push_back({view.name, view.intrinsics, view.world_from_camera});
  return cameras;
}

}  // namespace cnerf
