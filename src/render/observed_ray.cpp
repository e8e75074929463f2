#include "src/render/observed_ray.h"

namespace cnerf {
namespace {

/// The views of a capture in host memory.
struct HostViews {
  const std::vector<TrainingView>& views;
  std::span<const ViewCorrection> corrections;
  std::span<const GainField> light_fields;

  [[nodiscard]] std::uint32_t count() const { return std::uint32_t(views.size()); }
  [[nodiscard]] ImageSize size_of(std::uint32_t v) const { return {views[v].image->width, views[v].image->height}; }
  [[nodiscard]] const UnitCamera& camera(std::uint32_t v) const { return views[v].camera; }
  [[nodiscard]] ViewCorrection correction(std::uint32_t v) const {
    return corrections.empty() ? ViewCorrection() : corrections[v];
  }
  [[nodiscard]] bool is_valid(std::uint32_t v, std::size_t pixel) const { return views[v].image->valid(pixel); }
  [[nodiscard]] float luminance(std::uint32_t v, std::size_t pixel) const { return views[v].image->luminance(pixel); }
  [[nodiscard]] float coverage(std::uint32_t v, std::size_t pixel) const { return views[v].image->coverage(pixel); }
  [[nodiscard]] SkyLabel sky_label(std::uint32_t v, std::size_t pixel) const {
    return views[v].sky_labels == nullptr ? SkyLabel::kScene : (*views[v].sky_labels)[pixel];
  }
  [[nodiscard]] const GainField* light(std::uint32_t v) const {
    return light_fields.empty() ? nullptr : &light_fields[v];
  }
  [[nodiscard]] DepthHint depth(std::uint32_t v, int x, int y) const {
    const DepthHints* hints = views[v].depths;
    if (hints == nullptr) return {};
    const int column = hint_cell(x, views[v].image->width, hints->columns);
    const int row = hint_cell(y, views[v].image->height, hints->rows);
    return hints->cells[std::size_t(row) * std::size_t(hints->columns) + std::size_t(column)];
  }
  [[nodiscard]] DirectionView sky(std::uint32_t v) const { return views[v].sky->plane(0); }
};

}  // namespace

ObservedRay observe_ray(const std::vector<TrainingView>& views, std::uint64_t seed, std::uint64_t step,
                        std::uint64_t ray, std::span<const ViewCorrection> corrections,
                        std::span<const GainField> light) {
  return observe_ray(HostViews{views, corrections, light}, seed, step, ray);
}

}  // namespace cnerf
