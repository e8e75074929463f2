#include "export/vdb_file.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <limits>
#include <new>
#include <tuple>

#include "bake/volume/openvdb_grids.h"
#include "export/vdb_answer.h"
#include "src/base/error.h"

namespace cnerf::exporting {
namespace {
namespace fs = std::filesystem;

using GridMap = std::map<std::string, openvdb::GridBase::Ptr>;

/// What openvdb::io::File and io::Stream read, grid by grid, from a stream whose failures are seen: theirs go on at the
/// end of a file that was cut, with whatever their variables held.
class CheckedInput : public openvdb::io::Archive {
 public:
  explicit CheckedInput(const fs::path& path) {
    in_.exceptions(std::ios::failbit | std::ios::badbit | std::ios::eofbit);
    in_.open(path, std::ios::binary);
    readHeader(in_);
    setFormatVersion(in_);
    setLibraryVersion(in_);
    setDataCompression(in_);
    metadata_.readMeta(in_);
    count_ = readGridCount(in_);
    if (count_ < 0 || count_ > kMostGrids) {
      throw InputError(path, "grids",
                       "expected at most " + std::to_string(kMostGrids) + ", found " + std::to_string(count_));
    }
  }

  [[nodiscard]] const openvdb::MetaMap& metadata() const { return metadata_; }
  [[nodiscard]] std::int32_t count() const { return count_; }

  /// The next grid. @param is_wanted  of its name and type; others come empty
  openvdb::GridBase::Ptr next(const std::function<bool(const openvdb::GridBase&)>& is_wanted) {
    openvdb::io::GridDescriptor descriptor;
    openvdb::GridBase::Ptr grid = descriptor.read(in_);
    if (!grid) throw std::runtime_error("a grid without a type");
    grid->setName(descriptor.gridName());
    if (inputHasGridOffsets() && !is_wanted(*grid)) {
      descriptor.seekToEnd(in_);
      return grid;
    }
    if (inputHasGridOffsets()) descriptor.seekToGrid(in_);
    try {
      readGrid(grid, descriptor, in_);
    } catch (const std::bad_alloc&) {
      if (!inputHasGridOffsets()) throw;
      grid->newTree();
      grid->insertMeta(kTooLarge, openvdb::BoolMetadata(true));
    }
    if (descriptor.isInstance()) {
      connectInstance(descriptor, instances_);
    } else {
      instances_[descriptor.uniqueName()] = grid;
    }
    if (inputHasGridOffsets()) descriptor.seekToEnd(in_);
    return grid;
  }
  /// Lets go of what later grids may share.
  void forget() { instances_.clear(); }

  static constexpr const char* kTooLarge = "cnerf_too_large";  ///< marks a grid that memory did not suffice for

 private:
  std::ifstream in_;
  openvdb::MetaMap metadata_;
  std::int32_t count_ = 0;
  NamedGridMap instances_;
};

/// Whatever OpenVDB finds wrong, in our words.
template <typename Read>
auto read_checked(const fs::path& path, const Read& read) {
  openvdb::initialize();
  try {
    return read();
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::ios::failure&) {
    throw InputError(path.string() + ": not a readable OpenVDB file: it ends too early or is damaged");
  } catch (const std::exception& failure) {
    throw InputError(path.string() + ": not a readable OpenVDB file: " + failure.what());
  }
}

template <typename Grid>
typename Grid::Ptr find_grid(const GridMap& grids, const std::string& name) {
  const auto found = grids.find(name);
  return found == grids.end() ? nullptr : openvdb::gridPtrCast<Grid>(found->second);
}

template <typename T>
T meta_or(const openvdb::MetaMap& meta, const std::string& name, T fallback) {
  const auto found = meta.getMetadata<openvdb::TypedMetadata<T>>(name);
  return found ? found->value() : fallback;
}

void read_frame(const openvdb::MetaMap& meta, bake::Volume& volume) {
  const auto centre = meta_or<openvdb::Vec3d>(meta, "cnerf_world_centre", openvdb::Vec3d(0, 0, 0));
  const auto resolution = meta_or<openvdb::Vec3i>(meta, "cnerf_resolution", openvdb::Vec3i(0, 0, 0));
  volume.frame.world_centre = {centre.x(), centre.y(), centre.z()};
  volume.frame.unit_per_world = meta_or<double>(meta, "cnerf_unit_per_world", 1.0);
  volume.frame.cascades = meta_or<std::int32_t>(meta, "cnerf_cascades", 1);
  volume.resolution = {resolution.x(), resolution.y(), resolution.z()};
}

void read_transform(const std::filesystem::path& path, const openvdb::MetaMap& meta, const openvdb::GridBase& density,
                    bake::Volume& volume) {
  const openvdb::math::Transform& transform = density.transform();
  if (!transform.isLinear() || !transform.hasUniformScale()) {
    throw InputError(path, "density", "expected a transform with cubic voxels");
  }
  volume.voxel_size = transform.voxelSize().x();
  const bool centred = meta_or<std::string>(meta, "voxel_origin", "center") == "center";
  const auto upright = meta_or<openvdb::Mat4d>(meta, "cnerf_world_to_source", openvdb::Mat4d::identity());
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

Vec3i index_of(const openvdb::Coord& at) {
  return {at.x(), at.y(), at.z()};
}

/// @throws InputError  when going through all voxels would take more than any bake of ours holds
void check_size(const fs::path& path, const openvdb::FloatGrid& density) {
  const std::uint64_t voxels = density.activeVoxelCount(), in_leaves = density.tree().activeLeafVoxelCount();
  if (voxels == 0) throw InputError(path, "density", "holds no voxels");
  if (voxels > kMostVoxels || voxels - in_leaves > kMostTileVoxels) {
    throw InputError(path, "density",
                     "expected at most " + std::to_string(kMostVoxels) + " voxels and " +
                         std::to_string(kMostTileVoxels) + " of them in tiles, found " + std::to_string(voxels) +
                         " and " + std::to_string(voxels - in_leaves));
  }
  const openvdb::CoordBBox box = density.evalActiveVoxelBoundingBox();
  if (!is_legal_box(index_of(box.min()), index_of(box.max()))) {
    throw InputError(path, "density", "its voxels lie too far apart: their box would hold more than 4096^3");
  }
}

void read_voxels(const GridMap& grids, const openvdb::MetaMap& meta, const openvdb::FloatGrid& density,
                 bake::Volume& volume) {
  const auto color = find_grid<openvdb::Vec3SGrid>(grids, "color");
  const auto values = [&](const std::string& name) {
    const auto grid = find_grid<openvdb::FloatGrid>(grids, name);
    return grid ? grid : openvdb::FloatGrid::create();
  };
  const auto a = values("lab_a"), b = values("lab_b"), luminance = values("luminance");
  const auto of_density = density.getConstAccessor();
  const auto of_color = (color ? color : openvdb::Vec3SGrid::create())->getConstAccessor();
  const auto of_a = a->getConstAccessor(), of_b = b->getConstAccessor();
  const auto of_luminance = luminance->getConstAccessor();
  const auto scale = float(meta_or<double>(meta, "cnerf_density_scale", 1.0));
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
  std::ranges::sort(volume.voxels, {}, [](const bake::Voxel& v) { return std::tie(v.i, v.j, v.k); });
}

std::map<std::string, std::string> text_of(const openvdb::MetaMap& meta) {
  std::map<std::string, std::string> text;
  for (auto it = meta.beginMeta(); it != meta.endMeta(); ++it) text[it->first] = it->second->str();
  return text;
}

void widen(VdbGridSummary& summary, std::size_t component, double value) {
  if (!std::isfinite(value)) {
    ++summary.not_finite;
    return;
  }
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

/// What OpenVDB's writer says of a grid that is not in memory.
void describe_unread(const openvdb::GridBase& grid, VdbGridSummary& summary) {
  summary.active_voxels =
      std::uint64_t(std::max<openvdb::Int64>(0, meta_or<openvdb::Int64>(grid, "file_voxel_count", 0)));
  const auto corner = [&](const char* name) {
    const auto at = meta_or<openvdb::Vec3i>(grid, name, openvdb::Vec3i(0));
    return Vec3i{at.x(), at.y(), at.z()};
  };
  summary.index_min = corner("file_bbox_min");
  summary.index_max = corner("file_bbox_max");
}

VdbGridSummary summary_of(const openvdb::GridBase& grid) {
  VdbGridSummary summary;
  summary.name = grid.getName();
  summary.type = grid.valueType();
  summary.grid_class = openvdb::GridBase::gridClassToString(grid.getGridClass());
  summary.half = grid.saveFloatAsHalf();
  summary.metadata = text_of(grid);
  if (summary.metadata.erase(CheckedInput::kTooLarge) > 0) {
    describe_unread(grid, summary);
  } else {
    summary.active_voxels = grid.activeVoxelCount();
    if (summary.active_voxels > 0) {
      const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
      summary.index_min = index_of(box.min());
      summary.index_max = index_of(box.max());
      value_range(grid, summary);
    }
  }
  const openvdb::Vec3d size = grid.voxelSize();
  summary.voxel_size = {size.x(), size.y(), size.z()};
  const auto place = [&](const Vec3i& at) {
    const openvdb::Vec3d world = grid.indexToWorld(openvdb::Coord(at.x, at.y, at.z));
    return Vec3d{world.x(), world.y(), world.z()};
  };
  summary.world_box = {place(summary.index_min), place(summary.index_max)};
  return summary;
}

}  // namespace

bake::Volume volume_in(const fs::path& path) {
  return read_checked(path, [&] {
    CheckedInput input(path);
    GridMap grids;
    for (std::int32_t number = 0; number < input.count(); ++number) {
      const auto grid = input.next([](const openvdb::GridBase& each) {
        const std::string name = each.getName();
        return name == "density" || name == "color" || name == "lab_a" || name == "lab_b" || name == "luminance";
      });
      if ((*grid)[CheckedInput::kTooLarge]) throw std::bad_alloc();
      grids.emplace(grid->getName(), grid);
    }
    const auto density = find_grid<openvdb::FloatGrid>(grids, "density");
    if (!density) throw InputError(path, "density", "expected a float grid of this name");
    check_size(path, *density);
    bake::Volume volume;
    read_frame(input.metadata(), volume);
    read_transform(path, input.metadata(), *density, volume);
    read_voxels(grids, input.metadata(), *density, volume);
    return volume;
  });
}

VdbSummary summary_in(const fs::path& path) {
  return read_checked(path, [&] {
    CheckedInput input(path);
    VdbSummary summary;
    summary.metadata = text_of(input.metadata());
    for (std::int32_t number = 0; number < input.count(); ++number) {
      summary.grids.push_back(summary_of(*input.next([](const openvdb::GridBase&) { return true; })));
      input.forget();
    }
    return summary;
  });
}

}  // namespace cnerf::exporting
