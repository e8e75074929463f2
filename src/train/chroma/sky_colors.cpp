#include "src/train/chroma/sky_colors.h"

#include <algorithm>
#include <array>

#include "src/picture/picture.h"

namespace cnerf {
namespace {

constexpr float kMostOpacity = 0.5f;  // of the field before the sky, where a colour still is the sky's
constexpr float kKnownWeight = 1000;  // over that of an answer

}  // namespace

Ab mixed(Ab one, float light_of_one, Ab other, float light_of_other) {
  return ab_of_linear_rgb(linear_rgb_at(light_of_one, one) + linear_rgb_at(light_of_other, other));
}

void SkyColors::add(const CachedView& view, std::size_t pixel, Ab color, float weight) {
  if (view.opacity[pixel] > kMostOpacity || (!view.ignored.empty() && view.ignored[pixel] != 0)) return;
  const std::array<float, 2> ab = {color.a, color.b};
  sums_.add(view.camera.ray_of_pixel(pixel).direction, ab, weight * (1 - view.opacity[pixel]));
}

void SkyColors::add(std::span<const CachedView> views, const KnownColorMap& known) {
  for (const ViewPixel& place : known.places()) {
    add(views[place.view], place.pixel, *known.find(place.view, place.pixel), kKnownWeight);
  }
}

void SkyColors::refresh() {
  const std::size_t pixels = std::size_t(sums_.width()) * std::size_t(sums_.height());
  colors_ =
      is_grey() ? DirectionMap{sums_.width(), sums_.height(), {2, std::vector<float>(pixels, 0.0f)}} : sums_.filled();
}

Ab SkyColors::along(Vec3f direction) const {
  return {colors_.plane(0).along(direction), colors_.plane(1).along(direction)};
}

Ab SkyColors::behind(const CachedView& view, std::size_t pixel, float field_luminance, Ab color) const {
  const float light = std::max(view.luminance[pixel] - field_luminance, 0.0f);
  return mixed(color, field_luminance, along(view.camera.ray_of_pixel(pixel).direction), light);
}

Vec3f ColoredSky::along(Vec3f direction) const {
  const Ab color = colors != nullptr && colors->exists() ? colors->along(direction) : Ab{};
  return finish.gain() * linear_rgb_at(light.along(direction), finish.of(color));
}

}  // namespace cnerf
