#include "src/compare/baselines/torch_plugin.h"

#include "src/base/plugin.h"

namespace cnerf::compare {
namespace {

constexpr float kNearOfSurroundings = 0.02f;  // unit lengths, where a capture has no near bound

const TorchBaselines& torch_baselines() {
  return plugin_table<TorchBaselines>("compare_torch", "cnerf_torch_baselines");
}

}  // namespace

PositionalRays positional_rays(const Capture& capture, const SceneFrame& frame) {
  if (capture.depth_range) return {float(0.9 * capture.depth_range->near * frame.unit_per_world), true};
  if (frame.cascades == 1) return {};
  return {kNearOfSurroundings, true};
}

std::unique_ptr<Engines> positional_engines(const PositionalRays& rays, const Engines& others) {
  return torch_baselines().positional(rays, others);
}

std::unique_ptr<PictureLoss> make_style_loss(const std::filesystem::path& weights, const LabPicture& reference) {
  return torch_baselines().style(weights, reference);
}

std::unique_ptr<PictureLoss> make_text_loss(const TextGuide& guide) {
  return torch_baselines().text(guide);
}

}  // namespace cnerf::compare
