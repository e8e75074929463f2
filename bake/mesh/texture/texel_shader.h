#pragma once
/// The colour of points on a surface, from the field around them.

#include <span>
#include <vector>

#include "bake/lattice/plan.h"
#include "bake/visibility/view_selection.h"

namespace cnerf::bake {

struct SurfacePoint {
  Vec3f position{};  ///< voxel coordinates of the plan
  Vec3f normal{};    ///< unit length, outward
};

/// What is seen at a point, opaque as a mesh is.
struct SurfaceColor {
  float luminance = 0;          ///< linear Y
  Chromaticity chromaticity{};  ///< of the light, relative to luminance
  float opacity = 0;            ///< that the ray met; the colour is its share of it. 0: nothing there, no colour
};

/// Sends a short ray through the field at each point, from outside along the normal inwards, and composites what it
/// meets. A mesh lies a little off the matter it stands for: one sample at the point itself would often miss it.
/// A sample's luminance is the mean over the training views that see the point, weighted by how much of its light
/// reaches them and how squarely they look at it; where none does, it is what is seen along the ray.
class TexelShader {
 public:
  /// All references have to outlive the shader.
  TexelShader(const ColorField& field, const std::vector<Camera>& cameras, const Plan& plan, const Options& bake,
              const BrickGrid<float>& sigma);

  /// Thread-safe. Points that lie close together are answered faster in one call.
  /// @throws ContractError  when the field answers something that is not finite.
  [[nodiscard]] std::vector<SurfaceColor> shade(std::span<const SurfacePoint> points) const;
  [[nodiscard]] float gain() const { return field_.gain(); }

 private:
  struct Sample;
  struct View;
  [[nodiscard]] std::vector<Sample> samples_along_rays(std::span<const SurfacePoint> points,
                                                       std::vector<SurfaceColor>& colors) const;
  [[nodiscard]] std::vector<std::vector<View>> views_of(std::span<const SurfacePoint> points) const;

  const ColorField& field_;
  const Plan& plan_;
  ViewSelection views_;
};

}  // namespace cnerf::bake
