#include "export/vdb_writer.h"

#include <openvdb/openvdb.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>

#include "bake/dilate.h"
#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/files.h"

namespace cnerf {
namespace {

constexpr float kHalfMax = 65504.0f;
constexpr float kHalfMinNormal = 0x1p-14f;  ///< below it a half loses digits

void check_voxels(const BakedVolume& volume) {
  CNERF_CHECK(!volume.voxels.empty(), "an empty volume cannot be written");
  CNERF_CHECK(std::isfinite(volume.voxel_size) && volume.voxel_size > 0, "voxel size must be positive");
  for (const BakedVoxel& v : volume.voxels) {
    const bool finite = std::isfinite(v.sigma) && std::isfinite(v.luminance) && std::isfinite(v.rgb.x) &&
                        std::isfinite(v.rgb.y) && std::isfinite(v.rgb.z) && std::isfinite(v.a) && std::isfinite(v.b);
    CNERF_CHECK(finite && v.sigma >= 0, "voxel with NaN, infinity or negative density at " + std::to_string(v.i) +
                                            ", " + std::to_string(v.j) + ", " + std::to_string(v.k));
  }
}

openvdb::math::Transform::Ptr transform_of(const BakedVolume& volume, const VdbOptions& options) {
  const double shift = options.voxel_origin == "center" ? volume.voxel_size / 2 : 0;
  auto transform = openvdb::math::Transform::createLinearTransform(volume.voxel_size);
  transform->postTranslate({volume.origin.x + shift, volume.origin.y + shift, volume.origin.z + shift});
  return transform;
}

/// One grid over all voxels, with the value that `value_of` takes from each.
template <typename Grid, typename ValueOf>
typename Grid::Ptr make_grid(const std::string& name, const BakedVolume& volume, const ValueOf& value_of) {
  auto grid = Grid::create();  // background 0
  grid->setName(name);
  grid->setCreator("cnerf " CNERF_VERSION);
  grid->setGridClass(openvdb::GRID_FOG_VOLUME);
  auto accessor = grid->getAccessor();
  for (const BakedVoxel& voxel : volume.voxels) accessor.setValueOn({voxel.i, voxel.j, voxel.k}, value_of(voxel));
  return grid;
}

openvdb::Vec3SGrid::Ptr color_grid(const std::string& name, const BakedVolume& volume, float largest) {
  auto grid = make_grid<openvdb::Vec3SGrid>(name, volume, [&](const BakedVoxel& v) {
    return openvdb::Vec3s(std::min(v.rgb.x, largest), std::min(v.rgb.y, largest), std::min(v.rgb.z, largest));
  });
  grid->setVectorType(openvdb::VEC_INVARIANT);
  grid->insertMeta("colorspace", openvdb::StringMetadata("lin_rec709"));
  return grid;
}

openvdb::FloatGrid::Ptr float_grid(const std::string& name, const std::string& meaning, const BakedVolume& volume,
                                   float BakedVoxel::*member, float largest) {
  auto grid =
      make_grid<openvdb::FloatGrid>(name, volume, [&](const BakedVoxel& v) { return std::min(v.*member, largest); });
  grid->insertMeta("meaning", openvdb::StringMetadata(meaning));
  return grid;
}

openvdb::GridPtrVec make_grids(const BakedVolume& volume, const VdbOptions& options) {
  const float largest = options.half ? kHalfMax : std::numeric_limits<float>::max();
  const bool half_density = options.half && density_fits_half(volume);
  const auto density =
      float_grid("density", "extinction, 1/world unit", volume, &BakedVoxel::sigma, std::numeric_limits<float>::max());
  openvdb::GridPtrVec grids{density, color_grid("color", volume, largest)};
  if (options.houdini) grids.push_back(color_grid("Cd", volume, largest));
  grids.push_back(float_grid("lab_a", "CIE 1976 a, D65", volume, &BakedVoxel::a, largest));
  grids.push_back(float_grid("lab_b", "CIE 1976 b, D65", volume, &BakedVoxel::b, largest));
  grids.push_back(float_grid("luminance", "linear Y", volume, &BakedVoxel::luminance, largest));
  const auto transform = transform_of(volume, options);
  for (const auto& grid : grids) {
    grid->setTransform(transform);
    grid->setSaveFloatAsHalf(grid == density ? half_density : options.half);
  }
  return grids;
}

openvdb::MetaMap file_metadata(const BakedVolume& volume, const VdbOptions& options) {
  using Text = openvdb::StringMetadata;
  const SceneFrame& frame = volume.frame;
  openvdb::MetaMap meta;
  meta.insertMeta("cnerf_version", Text(CNERF_VERSION));
  meta.insertMeta("cnerf_world_to_source", openvdb::Mat4DMetadata(openvdb::Mat4d::identity()));
  meta.insertMeta("cnerf_unit_per_world", openvdb::DoubleMetadata(frame.unit_per_world));
  meta.insertMeta("cnerf_world_centre", openvdb::Vec3DMetadata(openvdb::Vec3d(
                                            frame.world_centre.x, frame.world_centre.y, frame.world_centre.z)));
  meta.insertMeta("cnerf_cascades", openvdb::Int32Metadata(frame.cascades));
  meta.insertMeta("cnerf_resolution", openvdb::Vec3IMetadata(openvdb::Vec3i(volume.resolution.x, volume.resolution.y,
                                                                            volume.resolution.z)));
  meta.insertMeta("units", Text(options.units));
  meta.insertMeta("up_axis", Text(options.up_axis));
  meta.insertMeta("colorspace", Text("lin_rec709"));
  meta.insertMeta("white", Text("D65"));
  meta.insertMeta("voxel_origin", Text(options.voxel_origin));
  meta.insertMeta("color_origin", Text(volume.colorizer.empty() ? "grey: not colorized" : "inferred by a colorizer"));
  meta.insertMeta("colorizer", Text(volume.colorizer));
  meta.insertMeta("take", Text(volume.take));
  return meta;
}

std::uint32_t compression_flags(const std::string& name) {
  if (name == "none") return openvdb::io::COMPRESS_ACTIVE_MASK;
  if (name == "zip" || !openvdb::io::Archive::hasBloscCompression()) {
    return openvdb::io::COMPRESS_ZIP | openvdb::io::COMPRESS_ACTIVE_MASK;
  }
  return openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK;
}

/// What openvdb::io::File writes, but to a stream whose failures are seen: File leaves a cut-off file on a full disk
/// and says nothing.
class CheckedArchive : public openvdb::io::Archive {
 public:
  explicit CheckedArchive(std::uint32_t compression) { setCompression(compression); }

  void save(const std::filesystem::path& file, const openvdb::GridPtrVec& grids, const openvdb::MetaMap& meta) const {
    errno = 0;
    std::ofstream out;
    out.exceptions(std::ios::failbit | std::ios::badbit);
    out.open(file, std::ios::binary | std::ios::trunc);
    write(out, grids, /*seekable=*/true, meta);
    out.close();
  }

 private:
  using openvdb::io::Archive::write;
};

void check_options(const VdbOptions& options) {
  CNERF_CHECK(options.voxel_origin == "center" || options.voxel_origin == "corner", options.voxel_origin);
  CNERF_CHECK(options.compression == "blosc" || options.compression == "zip" || options.compression == "none",
              options.compression);
  CNERF_CHECK(options.dilation >= 2 && options.padding >= 1, "dilation must be at least 2, padding at least 1");
}

}  // namespace

bool density_fits_half(const BakedVolume& volume) {
  return std::all_of(volume.voxels.begin(), volume.voxels.end(), [](const BakedVoxel& v) {
    return v.sigma == 0 || (v.sigma <= kHalfMax && v.sigma >= kHalfMinNormal);
  });
}

void write_vdb(const BakedVolume& volume, const std::filesystem::path& path, const VdbOptions& options) {
  check_options(options);
  check_voxels(volume);
  openvdb::initialize();
  BakedVolume padded = volume;
  dilate_colors(padded, options.dilation + options.padding);
  const openvdb::GridPtrVec grids = make_grids(padded, options);
  const openvdb::MetaMap meta = file_metadata(volume, options);
  write_atomically(path, [&](const std::filesystem::path& temporary) {
    try {
      CheckedArchive(compression_flags(options.compression)).save(temporary, grids, meta);
    } catch (const std::exception& failure) {
      throw OutputError(path.string() + ": cannot be written: " + (errno != 0 ? std::strerror(errno) : failure.what()));
    }
  });
}

}  // namespace cnerf
