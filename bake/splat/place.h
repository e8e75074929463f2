#pragma once
/// Where splats begin: flat discs on the surfaces that the field's pictures show.

#include <cstdint>
#include <span>
#include <vector>

#include "bake/splat/targets.h"

namespace cnerf::bake {

/// A splat with the distance to its neighbours, world units.
struct PlacedSplat {
  Splat splat;
  float spacing = 0;
};

/// A disc where a pixel looks, along the surface; nothing where the picture shows none: between two things, or where
/// the field is thin.
/// @param spacing  to its neighbours, world units
[[nodiscard]] std::optional<PlacedSplat> splat_at_pixel(const SplatTarget& target, int x, int y, double spacing);

/// At most `count` splats, as far from each other as the pixels that see them best ask for.
/// @throws InputError  where no picture shows anything
[[nodiscard]] std::vector<PlacedSplat> place_splats(std::span<const SplatTarget> targets, std::size_t count);

}  // namespace cnerf::bake
