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

/// Keeps values finite in what a file stores.
struct Stored {
  bool half = true;
  [[nodiscard]] float operator()(float value) const { return half ? std::clamp(value, -kHalfMax, kHalfMax) : value; }
};

openvdb::Vec3SGrid::Ptr color_grid(const std::string& name, const BakedVolume& volume, Stored stored) {
  auto grid = make_grid<openvdb::Vec3SGrid>(name, volume, [&](const BakedVoxel& v) {
    return openvdb::Vec3s(stored(v.rgb.x), stored(v.rgb.y), stored(v.rgb.z));
  });
  grid->setVectorType(openvdb::VEC_INVARIANT);
  grid->insertMeta("colorspace", openvdb::StringMetadata("lin_rec709"));
  return grid;
}

openvdb::Vec3SGrid::Ptr emission_grid(const BakedVolume& volume, Stored stored) {
  auto grid = make_grid<openvdb::Vec3SGrid>("emission", volume, [&](const BakedVoxel& v) {
    const Vec3f emission = v.rgb * v.sigma;
    return openvdb::Vec3s(stored(emission.x), stored(emission.y), stored(emission.z));
  });
  grid->setVectorType(openvdb::VEC_INVARIANT);
  grid->insertMeta("colorspace", openvdb::StringMetadata("lin_rec709"));
  grid->insertMeta("meaning", openvdb::StringMetadata("density times color, per world unit"));
  return grid;
}

openvdb::FloatGrid::Ptr float_grid(const std::string& name, const std::string& meaning, const BakedVolume& volume,
                                   float BakedVoxel::*member, Stored stored) {
  auto grid = make_grid<openvdb::FloatGrid>(name, volume, [&](const BakedVoxel& v) { return stored(v.*member); });
  grid->insertMeta("meaning", openvdb::StringMetadata(meaning));
  return grid;
}

openvdb::GridPtrVec make_grids(const BakedVolume& volume, const VdbOptions& options) {
  const Stored stored{options.half};
  const bool half_density = density_fits_half(volume, options);
  const double scale = density_scale(volume, options);
  const auto density = make_grid<openvdb::FloatGrid>(
      "density", volume, [&](const BakedVoxel& v) { return static_cast<float>(v.sigma / scale); });
  density->insertMeta("meaning",
                      openvdb::StringMetadata(options.normalize_density ? "extinction in units of cnerf_density_scale"
                                                                        : "extinction, 1/world unit"));
  openvdb::GridPtrVec grids{density, color_grid("color", volume, stored)};
  if (options.houdini) grids.push_back(color_grid("Cd", volume, stored));
  if (options.emission) grids.push_back(emission_grid(volume, stored));
  grids.push_back(float_grid("lab_a", "CIE 1976 a, D65", volume, &BakedVoxel::a, stored));
  grids.push_back(float_grid("lab_b", "CIE 1976 b, D65", volume, &BakedVoxel::b, stored));
  grids.push_back(float_grid("luminance", "linear Y", volume, &BakedVoxel::luminance, stored));
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
  meta.insertMeta("cnerf_density_scale", openvdb::DoubleMetadata(density_scale(volume, options)));
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

/// Two corners without density or colour: the box of what is active grows by `padding` voxels on every side.
void pad_box(BakedVolume& volume, int padding) {
  const VoxelBox box = bounding_box(volume.voxels);
  const Vec3i margin{padding, padding, padding};
  for (const Vec3i corner : {box.min - margin, box.min + box.size - Vec3i{1, 1, 1} + margin}) {
    BakedVoxel voxel;
    voxel.i = corner.x;
    voxel.j = corner.y;
    voxel.k = corner.z;
    volume.voxels.push_back(voxel);
  }
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

double density_scale(const BakedVolume& volume, const VdbOptions& options) {
  if (!options.normalize_density) return 1;
  float largest = 0;
  for (const BakedVoxel& v : volume.voxels) largest = std::max(largest, v.sigma);
  return largest > 0 ? largest : 1;
}

bool density_fits_half(const BakedVolume& volume, const VdbOptions& options) {
  if (!options.half) return false;
  const auto scale = static_cast<float>(density_scale(volume, options));
  return std::all_of(volume.voxels.begin(), volume.voxels.end(), [scale](const BakedVoxel& v) {
    const float stored = v.sigma / scale;
    return stored == 0 || (stored <= kHalfMax && stored >= kHalfMinNormal);
  });
}

void write_vdb(const BakedVolume& volume, const std::filesystem::path& path, const VdbOptions& options) {
  check_options(options);
  check_voxels(volume);
  openvdb::initialize();
  BakedVolume padded = volume;
  dilate_colors(padded, options.dilation);
  pad_box(padded, options.padding);
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
