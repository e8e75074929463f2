#include "bake/camera.h"

#include "src/capture/capture.h"

namespace cnerf::bake {

std::vector<Camera> cameras_of(const Capture& capture) {
  std::vector<Camera> cameras;
  for (const View& view : capture.views) cameras.push_back({view.name, view.intrinsics, view.world_from_camera});
  return cameras;
}

}  // namespace cnerf::bake
