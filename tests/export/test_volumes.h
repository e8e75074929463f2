#pragma once
/// Small baked volumes and photographs with known content.

#include "bake/volume.h"
#include "bake/volume/dilate.h"
#include "export/vdb_writer.h"
#include "export/web_pictures.h"

namespace cnerf::exporting::test {

/// Voxels [min, max) of one density and colour, not dilated, in a world whose voxel (0, 0, 0) starts at (1, 2, 3).
inline bake::Volume block_volume(Vec3i min, Vec3i max, float sigma, double voxel_size = 0.05,
                                 Vec3f rgb = {0.2f, 0.5f, 0.8f}) {
  bake::Volume volume;
  volume.origin = {1, 2, 3};
  volume.voxel_size = voxel_size;
  volume.resolution = max + Vec3i{4, 4, 4};
  volume.frame = {{1.5, 2.5, 3.5}, 0.125, 2};
  for (int i = min.x; i < max.x; ++i)
    for (int j = min.y; j < max.y; ++j)
      for (int k = min.z; k < max.z; ++k) volume.voxels.push_back({i, j, k, sigma, 0.457f, rgb, -3.5f, -31.25f});
  return volume;
}

/// @param luminance  [H, W] linear Y
inline WebPhoto make_web_photo(const Intrinsics& lens, const std::vector<float>& luminance, int side, int quality) {
  View view;
  view.intrinsics = lens;
  view.image.width = lens.width;
  view.image.height = lens.height;
  view.image.depth = PixelDepth::kF32;
  view.image.f32 = luminance;
  return make_web_photos({&view, 1}, side, quality).front();
}

/// Of a take "first" by the built-in colorizer.
inline Label label_of_first(const std::string& up_axis = "z", const std::string& units = "scene units") {
  return {{"builtin", "first", {"cnerf", "bake", "run"}}, {units, up_axis}};
}

/// As a bake writes it: colours reach beyond density.
inline void write_dilated(const bake::Volume& volume, const std::filesystem::path& file, const VdbOptions& options = {},
                          int reach = 2, const Label& label = label_of_first()) {
  write_vdb(dilated(planes_of(volume), reach), file, options, label);
}

}  // namespace cnerf::exporting::test
