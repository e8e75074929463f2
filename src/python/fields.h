#pragma once
/// Trained scenes and bakes that are asked from Python.

#include <memory>
#include <string>

#include "src/train/scene.h"

namespace cnerf::python {

struct OpenScene {
  std::unique_ptr<const Scene> scene;
  std::string take;  ///< empty = grey
  RenderOptions options;
};

}  // namespace cnerf::python
