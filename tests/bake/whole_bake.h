#pragma once
/// Bakes in one call, in memory: what a job does step by step.

#include "bake/density/density_pass.h"
#include "bake/mesh/bake_mesh.h"
#include "bake/volume/bake_volumes.h"
#include "bake/volume/dilate.h"

namespace cnerf::bake::test {

/// On the processor.
inline std::vector<VolumePlanes> bake_volumes(const ColorField& field, const std::vector<Camera>& cameras,
                                              const std::vector<Level>& levels, const Options& options,
                                              Journal& journal, const ProgressSink& progress = {}) {
  ViewSelection views(cameras, density_levels(levels), options);
  views.map_depths();
  return bake::bake_volumes(field, views, levels, options, journal, progress);
}

/// On one lattice whatever `options.grids` says; colours are dilated by `options.dilation`.
inline Volume bake_volume(const ColorField& field, const std::vector<Camera>& cameras, const Options& options,
                          const ProgressSink& progress = {}) {
  Journal journal;
  const std::vector<Level> levels = bake_levels(field, {plan_bake(field, options)}, options, journal, progress);
  return whole_volume(
      dilated(bake_volumes(field, cameras, levels, options, journal, progress).front(), options.dilation));
}

/// After baking density on one lattice.
inline Mesh bake_mesh(const ColorField& field, const std::vector<Camera>& cameras, const Options& bake,
                      const MeshOptions& options) {
  const Plan plan = plan_bake(field, bake);
  return bake::bake_mesh(field, cameras, {plan, bake_density(field, plan, bake, [](double) {})}, bake, options);
}

}  // namespace cnerf::bake::test
