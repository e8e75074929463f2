#pragma once
/// Options of a run that takes a second or two.

#include <string>
#include <vector>

namespace cnerf::test {

/// @param overrides  more of the kind "key=value", which win
[[nodiscard]] inline std::vector<std::string> tiny_options(const std::vector<std::string>& overrides = {}) {
  std::vector<std::string> settings = {"stage1.steps=60",
                                       "stage1.samples_per_step=4096",
                                       "stage1.checkpoint_every=20",
                                       "stage1.steps_per_box=64",
                                       "stage1.grid.levels=4",
                                       "stage1.grid.log2_rows=12",
                                       "stage1.grid.finest_resolution=64",
                                       "colorizer.reference_steps=2",
                                       "stage2.patches=6",
                                       "stage2.patch_size=32",
                                       "stage2.rays_per_patch=256",
                                       "stage2.working_resolution=32",
                                       "stage2.distill_steps=2",
                                       "stage2.colorizer_batch=2",
                                       "stage2.grid.levels=4",
                                       "stage2.grid.log2_rows=12",
                                       "stage2.grid.finest_resolution=64",
                                       "stage2.purify.enabled=false",
                                       "stage2.purify.base_images=2",
                                       "bake.resolution=32",
                                       "mesh.texture_size=256",
                                       "render.frames=3",
                                       "render.short_side=32",
                                       "render.steps_per_box=64"};
  settings.insert(settings.end(), overrides.begin(), overrides.end());
  std::vector<std::string> options;
  for (const std::string& setting : settings) options.insert(options.end(), {"--set", setting});
  return options;
}

}  // namespace cnerf::test
