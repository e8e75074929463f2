#include "src/compare/baselines/torch_plugin.h"

#include "src/base/plugin.h"

namespace cnerf::compare {
namespace {

constexpr float kNearOfSurroundings = 0.02f;  // unit lengths, where a capture has no near bound

}  // namespace

const TorchBaselines& torch_baselines() {
  return plugin_table<TorchBaselines>("compare_torch", "cnerf_torch_baselines");
}

PositionalRays positional_rays(const Capture& capture, const SceneFrame& frame) {
  if (capture.depth_range) return {float(0.9 * capture.depth_range->near * frame.unit_per_world), true};
  if (frame.cascades == 1) return {};
  return {kNearOfSurroundings, true};
}

std::unique_ptr<Engines> positional_engines(const PositionalRays& rays, const Engines& others) {
  return torch_baselines().positional_engines(rays, others);
}

StyleLoss::StyleLoss(const std::filesystem::path& network, const LabPicture& reference)
    : network_(torch_baselines().style_network(network, reference)) {}

StyleLoss::~StyleLoss() = default;

const std::string& StyleLoss::network() const {
  return network_->name();
}

double StyleLoss::operator()(const LabPicture& picture, std::span<float> gradient) const {
  return network_->loss(picture, gradient);
}

}  // namespace cnerf::compare
