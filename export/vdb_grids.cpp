#include "export/vdb_grids.h"

#include <openvdb/tools/Prune.h>

#include <algorithm>
#include <cmath>

#include "bake/dilate.h"
#include "export/up_axis.h"
#include "src/base/check.h"
#include "src/base/parallel.h"

namespace cnerf {

class VdbGrids::Builder {
 public:
  Builder() = default;
  virtual ~Builder() = default;
  Builder(const Builder&) = delete;
  Builder& operator=(const Builder&) = delete;

  /// Of one part of the volume; parts may be added at the same time.
  virtual void add(std::size_t part, std::span<const BakedVoxel> voxels) = 0;
  [[nodiscard]] virtual openvdb::GridBase::Ptr finish() = 0;
};

namespace {

using Content = VdbGrids::Content;
using BuilderPtr = std::unique_ptr<VdbGrids::Builder>;

constexpr float kHalfMax = 65504.0f;
constexpr float kHalfMinNormal = 0x1p-14f;  ///< below it a half loses digits

VoxelBox grown(const VoxelBox& box, int margin) {
  const Vec3i m{margin, margin, margin};
  return {box.min - m, box.size + m + m};
}

VoxelBox both(const VoxelBox& a, const VoxelBox& b) {
  VoxelBox box;
  for (int axis = 0; axis < 3; ++axis) {
    box.min[axis] = std::min(a.min[axis], b.min[axis]);
    box.size[axis] = std::max(a.min[axis] + a.size[axis], b.min[axis] + b.size[axis]) - box.min[axis];
  }
  return box;
}

void check_options(const VdbOptions& options) {
  CNERF_CHECK(options.voxel_origin == "center" || options.voxel_origin == "corner", options.voxel_origin);
  CNERF_CHECK(options.compression == "blosc" || options.compression == "zip" || options.compression == "none",
              options.compression);
  CNERF_CHECK(options.up == "poses" || options.up == "y" || options.up == "z", options.up);
  CNERF_CHECK(options.dilation >= 2 && options.padding >= 1, "dilation must be at least 2, padding at least 1");
}

Content content_of(const VolumePlanes& volume, const VdbOptions& options) {
  check_options(options);
  CNERF_CHECK(std::isfinite(volume.voxel_size) && volume.voxel_size > 0, "voxel size must be positive");
  openvdb::initialize();
  const VolumeStatistics statistics = statistics_of(volume);
  CNERF_CHECK(statistics.all.size.x > 0, "an empty volume cannot be written");
  VoxelBox active = statistics.all;
  if (statistics.voxels > 0) active = both(active, grown(statistics.dense, options.dilation));
  return {dilated(volume, options.dilation), statistics, grown(active, options.padding), options};
}

openvdb::Mat4d row_vector_matrix(const Affined& map) {
  openvdb::Mat4d matrix = openvdb::Mat4d::identity();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) matrix(column, row) = map.linear.rows[row][column];
    matrix(3, row) = map.translation[row];
  }
  return matrix;
}

openvdb::math::Transform::Ptr transform_of(const VolumeHeader& volume, const VdbOptions& options) {
  const double shift = options.voxel_origin == "center" ? volume.voxel_size / 2 : 0;
  auto transform = openvdb::math::Transform::createLinearTransform(volume.voxel_size);
  transform->postTranslate({volume.origin.x + shift, volume.origin.y + shift, volume.origin.z + shift});
  const Affined turn = file_from_world(options);
  if (!(turn.linear == Mat3d::identity())) transform->postMult(row_vector_matrix(turn));
  return transform;
}

/// One grid over all voxels, with the value that `value_of` takes from each. Two corners without density or colour keep
/// the box of what is active open.
template <typename Grid, typename ValueOf>
class GridBuilder final : public VdbGrids::Builder {
 public:
  GridBuilder(const std::string& name, const Content& content, ValueOf value_of)
      : grid_(Grid::create()), box_(content.box), value_of_(std::move(value_of)) {  // background 0
    grid_->setName(name);
    grid_->setCreator("cnerf " CNERF_VERSION);
    grid_->setGridClass(openvdb::GRID_FOG_VOLUME);
    for (std::size_t part = 0; part < part_count(content.volume); ++part) {
      trees_.push_back(std::make_shared<Tree>(grid_->background()));
    }
  }
  [[nodiscard]] Grid& grid() { return *grid_; }

  void add(std::size_t part, std::span<const BakedVoxel> voxels) override {
    openvdb::tree::ValueAccessor<Tree> accessor(*trees_[part]);
    for (const BakedVoxel& voxel : voxels) accessor.setValueOn({voxel.i, voxel.j, voxel.k}, value_of_(voxel));
  }
  [[nodiscard]] openvdb::GridBase::Ptr finish() override {
    for (const auto& tree : trees_) grid_->tree().merge(*tree, openvdb::MERGE_ACTIVE_STATES);
    const Vec3i low = box_.min, high = low + box_.size - Vec3i{1, 1, 1};
    for (const Vec3i corner : {low, high}) {
      grid_->tree().setValueOn({corner.x, corner.y, corner.z}, value_of_(BakedVoxel{}));
    }
    openvdb::tools::prune(grid_->tree());  // full leaves of one value, as the insides of a grey bake's colours
    return grid_;
  }

 private:
  using Tree = typename Grid::TreeType;

  typename Grid::Ptr grid_;
  VoxelBox box_;
  ValueOf value_of_;
  std::vector<typename Tree::Ptr> trees_;  ///< of the parts, which end where leaves do: no leaf is in two of them
};

template <typename Grid, typename ValueOf>
std::unique_ptr<GridBuilder<Grid, ValueOf>> grid_builder(const std::string& name, const Content& content,
                                                         ValueOf value_of) {
  return std::make_unique<GridBuilder<Grid, ValueOf>>(name, content, std::move(value_of));
}

/// Keeps values finite in what a file stores.
struct Stored {
  bool half = true;
  [[nodiscard]] float operator()(float value) const { return half ? std::clamp(value, -kHalfMax, kHalfMax) : value; }
};

BuilderPtr color_grid(const std::string& name, const Content& content) {
  auto builder =
      grid_builder<openvdb::Vec3SGrid>(name, content, [stored = Stored{content.options.half}](const BakedVoxel& v) {
        return openvdb::Vec3s(stored(v.rgb.x), stored(v.rgb.y), stored(v.rgb.z));
      });
  builder->grid().setVectorType(openvdb::VEC_INVARIANT);
  builder->grid().insertMeta("colorspace", openvdb::StringMetadata("lin_rec709"));
  return builder;
}

BuilderPtr emission_grid(const Content& content) {
  auto builder = grid_builder<openvdb::Vec3SGrid>(
      "emission", content, [stored = Stored{content.options.half}](const BakedVoxel& v) {
        const Vec3f emission = v.rgb * v.sigma;
        return openvdb::Vec3s(stored(emission.x), stored(emission.y), stored(emission.z));
      });
  builder->grid().setVectorType(openvdb::VEC_INVARIANT);
  builder->grid().insertMeta("colorspace", openvdb::StringMetadata("lin_rec709"));
  builder->grid().insertMeta("meaning", openvdb::StringMetadata("density times color, per world unit"));
  return builder;
}

BuilderPtr float_grid(const std::string& name, const std::string& meaning, const Content& content,
                      float BakedVoxel::*member) {
  auto builder = grid_builder<openvdb::FloatGrid>(
      name, content,
      [stored = Stored{content.options.half}, member](const BakedVoxel& v) { return stored(v.*member); });
  builder->grid().insertMeta("meaning", openvdb::StringMetadata(meaning));
  return builder;
}

BuilderPtr density_grid(const Content& content) {
  auto builder = grid_builder<openvdb::FloatGrid>(
      "density", content, [scale = density_scale(content.statistics, content.options)](const BakedVoxel& v) {
        return float(v.sigma / scale);
      });
  builder->grid().insertMeta("meaning", openvdb::StringMetadata(content.options.normalize_density
                                                                    ? "extinction in units of cnerf_density_scale"
                                                                    : "extinction, 1/world unit"));
  return builder;
}

}  // namespace

Affined file_from_world(const VdbOptions& options) {
  return options.up == "poses" ? Affined{} : turned_up(options.up_axis, options.up);
}

double density_scale(const VolumeStatistics& volume, const VdbOptions& options) {
  return options.normalize_density && volume.max_sigma > 0 ? volume.max_sigma : 1;
}

bool density_fits_half(const VolumeStatistics& volume, const VdbOptions& options) {
  if (!options.half || volume.voxels == 0) return options.half;
  const auto scale = float(density_scale(volume, options));
  return volume.max_sigma / scale <= kHalfMax && volume.min_sigma / scale >= kHalfMinNormal;
}

VdbGrids::VdbGrids(const VolumePlanes& volume, const VdbOptions& options)
    : content_(content_of(volume, options)), transform_(transform_of(volume, options)) {
  const auto color = [](const char* name) { return [name](const Content& c) { return color_grid(name, c); }; };
  const auto scalar = [](const char* name, const char* meaning, float BakedVoxel::*member) {
    return [=](const Content& c) { return float_grid(name, meaning, c, member); };
  };
  const bool half = options.half;
  recipes_ = {{density_grid, density_fits_half(content_.statistics, options)}, {color("color"), half}};
  if (options.houdini) recipes_.push_back({color("Cd"), half});
  if (options.emission) recipes_.push_back({emission_grid, half});
  recipes_.push_back({scalar("lab_a", "CIE 1976 a, D65", &BakedVoxel::a), half});
  recipes_.push_back({scalar("lab_b", "CIE 1976 b, D65", &BakedVoxel::b), half});
  recipes_.push_back({scalar("luminance", "linear Y", &BakedVoxel::luminance), half});
}

openvdb::GridBase::Ptr VdbGrids::make(std::size_t number) const {
  return make(std::span(recipes_).subspan(number, 1)).front();
}

std::vector<openvdb::GridBase::Ptr> VdbGrids::make_all() const {
  return make(std::span(recipes_));
}

std::vector<openvdb::GridBase::Ptr> VdbGrids::make(std::span<const Recipe> recipes) const {
  std::vector<BuilderPtr> builders;
  for (const Recipe& recipe : recipes) builders.push_back(recipe.begin(content_));
  visit_parts(content_.volume, [&](std::size_t part, const std::vector<BakedVoxel>& voxels) {
    for (const BuilderPtr& builder : builders) builder->add(part, voxels);
  });
  std::vector<openvdb::GridBase::Ptr> grids(recipes.size());
  parallel_tasks(recipes.size(), [&](std::size_t g) {
    grids[g] = builders[g]->finish();
    grids[g]->setTransform(transform_->copy());
    grids[g]->setSaveFloatAsHalf(recipes[g].half);
  });
  return grids;
}

openvdb::MetaMap VdbGrids::file_metadata() const {
  using Text = openvdb::StringMetadata;
  const VolumePlanes& volume = content_.volume;
  const VdbOptions& options = content_.options;
  const SceneFrame& frame = volume.frame;
  openvdb::MetaMap meta;
  meta.insertMeta("cnerf_version", Text(CNERF_VERSION));
  meta.insertMeta("cnerf_world_to_source",
                  openvdb::Mat4DMetadata(row_vector_matrix(file_from_world(options).inverse())));
  meta.insertMeta("cnerf_unit_per_world", openvdb::DoubleMetadata(frame.unit_per_world));
  meta.insertMeta("cnerf_world_centre", openvdb::Vec3DMetadata(openvdb::Vec3d(
                                            frame.world_centre.x, frame.world_centre.y, frame.world_centre.z)));
  meta.insertMeta("cnerf_cascades", openvdb::Int32Metadata(frame.cascades));
  meta.insertMeta("cnerf_resolution", openvdb::Vec3IMetadata(openvdb::Vec3i(volume.resolution.x, volume.resolution.y,
                                                                            volume.resolution.z)));
  meta.insertMeta("cnerf_density_scale", openvdb::DoubleMetadata(density_scale(content_.statistics, options)));
  meta.insertMeta("units", Text(options.units));
  meta.insertMeta("up_axis", Text(options.up == "poses" ? options.up_axis : options.up));
  meta.insertMeta("up_axis_of_the_poses", Text(options.up_axis));
  meta.insertMeta("colorspace", Text("lin_rec709"));
  meta.insertMeta("white", Text("D65"));
  meta.insertMeta("voxel_origin", Text(options.voxel_origin));
  meta.insertMeta("color_origin", Text(volume.colorizer.empty() ? "grey: not colorized" : "inferred by a colorizer"));
  meta.insertMeta("colorizer", Text(volume.colorizer));
  meta.insertMeta("take", Text(volume.take));
  return meta;
}

}  // namespace cnerf
