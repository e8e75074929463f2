#include "export/vdb_reader.h"

#include <openvdb/openvdb.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "bake/volume/dilate.h"
#include "export/manifest.h"
#include "src/base/error.h"

namespace cnerf::exporting {
namespace {

struct OpenedFile {
  openvdb::GridPtrVec grids;
  openvdb::MetaMap metadata;
};

OpenedFile open_vdb(const std::filesystem::path& path) {
  if (!std::filesystem::exists(path)) throw MissingInputError(path.string() + ": no such file");
  openvdb::initialize();
  try {
    openvdb::io::File file(path.string());
    file.open(/*delayLoad=*/false);
    OpenedFile opened{*file.getGrids(), *file.getMetadata()};
    file.close();
    return opened;
  } catch (const std::exception& failure) {
    throw InputError(path.string() + ": not a readable OpenVDB file: " + failure.what());
  }
}

template <typename Grid>
typename Grid::Ptr find_grid(const OpenedFile& file, const std::string& name) {
  for (const auto& grid : file.grids) {
    if (grid->getName() == name) return openvdb::gridPtrCast<Grid>(grid);
  }
  return nullptr;
}

template <typename T>
T meta_or(const openvdb::MetaMap& meta, const std::string& name, T fallback) {
  const auto found = meta.getMetadata<openvdb::TypedMetadata<T>>(name);
  return found ? found->value() : fallback;
}

void read_frame(const OpenedFile& file, bake::Volume& volume) {
  const auto centre = meta_or<openvdb::Vec3d>(file.metadata, "cnerf_world_centre", openvdb::Vec3d(0, 0, 0));
  const auto resolution = meta_or<openvdb::Vec3i>(file.metadata, "cnerf_resolution", openvdb::Vec3i(0, 0, 0));
  volume.frame.world_centre = {centre.x(), centre.y(), centre.z()};
  volume.frame.unit_per_world = meta_or<double>(file.metadata, "cnerf_unit_per_world", 1.0);
  volume.frame.cascades = meta_or<std::int32_t>(file.metadata, "cnerf_cascades", 1);
  volume.resolution = {resolution.x(), resolution.y(), resolution.z()};
}

void read_transform(const std::filesystem::path& path, const OpenedFile& file, const openvdb::GridBase& density,
                    bake::Volume& volume) {
  const openvdb::math::Transform& transform = density.transform();
  if (!transform.isLinear() || !transform.hasUniformScale()) {
    throw InputError(path, "density", "expected a transform with cubic voxels");
  }
  volume.voxel_size = transform.voxelSize().x();
  const bool centred = meta_or<std::string>(file.metadata, "voxel_origin", "center") == "center";
  const auto upright = meta_or<openvdb::Mat4d>(file.metadata, "cnerf_world_to_source", openvdb::Mat4d::identity());
  const auto world = [&](double i, double j, double k) {
    return upright.transform(transform.indexToWorld(openvdb::Vec3d(i, j, k)));
  };
  const openvdb::Vec3d first = world(0, 0, 0);
  const double h = volume.voxel_size;
  const openvdb::Vec3d expected[] = {{h, 0, 0}, {0, h, 0}, {0, 0, h}};
  const openvdb::Vec3d steps[] = {world(1, 0, 0) - first, world(0, 1, 0) - first, world(0, 0, 1) - first};
  for (int axis = 0; axis < 3; ++axis) {
    if ((steps[axis] - expected[axis]).length() > 1e-6 * h) {
      throw InputError(path, "density", "expected voxels along the axes of the poses' frame");
    }
  }
  const double shift = centred ? volume.voxel_size / 2 : 0;
  volume.origin = {first.x() - shift, first.y() - shift, first.z() - shift};
}

/// Every active voxel of a grid, those of tiles one by one.
template <typename Grid>
void for_each_active(const Grid& grid, const std::function<void(const openvdb::Coord&)>& visit) {
  for (auto it = grid.cbeginValueOn(); it; ++it) {
    const openvdb::CoordBBox box = it.getBoundingBox();
    for (auto at = box.begin(); at; ++at) visit(*at);
  }
}

void read_voxels(const OpenedFile& file, const openvdb::FloatGrid& density, bake::Volume& volume) {
  const auto color = find_grid<openvdb::Vec3SGrid>(file, "color");
  const auto values = [&](const std::string& name) {
    const auto grid = find_grid<openvdb::FloatGrid>(file, name);
    return grid ? grid : openvdb::FloatGrid::create();
  };
  const auto a = values("lab_a"), b = values("lab_b"), luminance = values("luminance");
  const auto of_density = density.getConstAccessor();
  const auto of_color = (color ? color : openvdb::Vec3SGrid::create())->getConstAccessor();
  const auto of_a = a->getConstAccessor(), of_b = b->getConstAccessor();
  const auto of_luminance = luminance->getConstAccessor();
  const auto scale = float(meta_or<double>(file.metadata, "cnerf_density_scale", 1.0));
  for_each_active(density, [&](const openvdb::Coord& at) {
    const openvdb::Vec3s rgb = color ? of_color.getValue(at) : openvdb::Vec3s(0, 0, 0);
    volume.voxels.push_back({at.x(),
                             at.y(),
                             at.z(),
                             of_density.getValue(at) * scale,
                             of_luminance.getValue(at),
                             {rgb.x(), rgb.y(), rgb.z()},
                             of_a.getValue(at),
                             of_b.getValue(at)});
  });
  sort_voxels(volume.voxels);
}

std::map<std::string, std::string> text_of(const openvdb::MetaMap& meta) {
  std::map<std::string, std::string> text;
  for (auto it = meta.beginMeta(); it != meta.endMeta(); ++it) text[it->first] = it->second->str();
  return text;
}

void widen(VdbGridSummary& summary, std::size_t component, double value) {
  summary.min_value[component] = std::min(summary.min_value[component], value);
  summary.max_value[component] = std::max(summary.max_value[component], value);
}

void start_range(VdbGridSummary& summary, std::size_t components) {
  summary.min_value.assign(components, std::numeric_limits<double>::infinity());
  summary.max_value.assign(components, -std::numeric_limits<double>::infinity());
}

void value_range(const openvdb::GridBase& grid, VdbGridSummary& summary) {
  if (const auto* scalar = dynamic_cast<const openvdb::FloatGrid*>(&grid)) {
    start_range(summary, 1);
    for (auto it = scalar->cbeginValueOn(); it; ++it) widen(summary, 0, *it);
  } else if (const auto* vector = dynamic_cast<const openvdb::Vec3SGrid*>(&grid)) {
    start_range(summary, 3);
    for (auto it = vector->cbeginValueOn(); it; ++it) {
      for (int c = 0; c < 3; ++c) widen(summary, std::size_t(c), (*it)[c]);
    }
  }
}

VdbGridSummary summary_of(const openvdb::GridBase& grid) {
  VdbGridSummary summary;
  summary.name = grid.getName();
  summary.type = grid.valueType();
  summary.grid_class = openvdb::GridBase::gridClassToString(grid.getGridClass());
  summary.half = grid.saveFloatAsHalf();
  summary.active_voxels = grid.activeVoxelCount();
  const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
  summary.index_min = {box.min().x(), box.min().y(), box.min().z()};
  summary.index_max = {box.max().x(), box.max().y(), box.max().z()};
  const openvdb::Vec3d size = grid.voxelSize();
  summary.voxel_size = {size.x(), size.y(), size.z()};
  const openvdb::Vec3d low = grid.indexToWorld(box.min()), high = grid.indexToWorld(box.max());
  summary.world_box = {{low.x(), low.y(), low.z()}, {high.x(), high.y(), high.z()}};
  value_range(grid, summary);
  summary.metadata = text_of(grid);
  return summary;
}

}  // namespace

bake::Volume read_vdb(const std::filesystem::path& path) {
  const OpenedFile file = open_vdb(path);
  const auto density = find_grid<openvdb::FloatGrid>(file, "density");
  if (!density) throw InputError(path, "density", "expected a float grid of this name");
  bake::Volume volume;
  read_frame(file, volume);
  read_transform(path, file, *density, volume);
  read_voxels(file, *density, volume);
  return volume;
}

std::vector<bake::Volume> read_volumes(const std::filesystem::path& bake_folder) {
  const BakeManifest manifest = read_manifest(bake_folder / "manifest.json");
  if (!manifest.volume) {
    throw InputError(bake_folder / "manifest.json", "volume", "this bake has none; bake with --format vdb");
  }
  std::vector<bake::Volume> volumes;
  for (const ManifestVolume& finer : manifest.finer_volumes) volumes.push_back(read_vdb(bake_folder / finer.file));
  volumes.push_back(read_vdb(bake_folder / manifest.volume->file));
  return volumes;
}

VdbSummary summarize_vdb(const std::filesystem::path& path) {
  const OpenedFile file = open_vdb(path);
  VdbSummary summary;
  summary.metadata = text_of(file.metadata);
  for (const auto& grid : file.grids) summary.grids.push_back(summary_of(*grid));
  return summary;
}

}  // namespace cnerf::exporting
