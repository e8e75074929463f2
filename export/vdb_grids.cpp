#include "export/vdb_grids.h"

#include <openvdb/tools/Prune.h>

#include <algorithm>
#include <cmath>

#include "export/up_axis.h"
#include "src/base/check.h"
#include "src/base/parallel.h"

namespace cnerf::exporting {

class VdbGrids::Builder {
 public:
  Builder() = default;
  virtual ~Builder() = default;
  Builder(const Builder&) = delete;
  Builder& operator=(const Builder&) = delete;

  /// Of one part of the volume; parts may be added at the same time.
  virtual void add(std::size_t part, std::span<const bake::Voxel> voxels) = 0;
  [[nodiscard]] virtual openvdb::GridBase::Ptr finish() = 0;
};

namespace {

using Content = VdbGrids::Content;
using BuilderPtr = std::unique_ptr<VdbGrids::Builder>;

constexpr int kPadding = 1;  ///< voxels of zeros around what is active
constexpr float kHalfMax = 65504.0f;
constexpr float kHalfMinNormal = 0x1p-14f;  ///< below it a half loses digits

void check_options(const VdbOptions& options) {
  CNERF_CHECK(options.voxel_origin == "center" || options.voxel_origin == "corner", options.voxel_origin);
  CNERF_CHECK(options.compression == "blosc" || options.compression == "zip" || options.compression == "none",
              options.compression);
  CNERF_CHECK(options.up == "poses" || options.up == "y" || options.up == "z", options.up);
}

Content content_of(const bake::VolumePlanes& volume, const VdbOptions& options, const Label& label) {
  check_options(options);
  CNERF_CHECK(std::isfinite(volume.voxel_size) && volume.voxel_size > 0, "voxel size must be positive");
  CNERF_CHECK(!volume.statistics.all.is_empty(), "an empty volume cannot be written");
  openvdb::initialize();
  return {volume, volume.statistics.all.grown(kPadding), options, label};
}

openvdb::Mat4d row_vector_matrix(const Affined& map) {
  openvdb::Mat4d matrix = openvdb::Mat4d::identity();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) matrix(column, row) = map.linear.rows[row][column];
    matrix(3, row) = map.translation[row];
  }
  return matrix;
}

openvdb::math::Transform::Ptr transform_of(const bake::VolumeHeader& volume, const VdbOptions& options,
                                           const WorldConvention& world) {
  const double shift = options.voxel_origin == "center" ? volume.voxel_size / 2 : 0;
  auto transform = openvdb::math::Transform::createLinearTransform(volume.voxel_size);
  transform->postTranslate({volume.origin.x + shift, volume.origin.y + shift, volume.origin.z + shift});
  const Affined turn = file_from_world(options, world);
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

  void add(std::size_t part, std::span<const bake::Voxel> voxels) override {
    openvdb::tree::ValueAccessor<Tree> accessor(*trees_[part]);
    for (const bake::Voxel& voxel : voxels) accessor.setValueOn({voxel.i, voxel.j, voxel.k}, value_of_(voxel));
  }
  [[nodiscard]] openvdb::GridBase::Ptr finish() override {
    for (const auto& tree : trees_) grid_->tree().merge(*tree, openvdb::MERGE_ACTIVE_STATES);
    const Vec3i low = box_.min, high = low + box_.size - Vec3i{1, 1, 1};
    for (const Vec3i corner : {low, high}) {
      grid_->tree().setValueOn({corner.x, corner.y, corner.z}, value_of_(bake::Voxel{}));
    }
    openvdb::tools::prune(grid_->tree());  // full leaves of one value, as the insides of a grey bake's colours
    return grid_;
  }

 private:
  using Tree = typename Grid::TreeType;

  typename Grid::Ptr grid_;
  bake::VoxelBox box_;
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
      grid_builder<openvdb::Vec3SGrid>(name, content, [stored = Stored{content.options.half}](const bake::Voxel& v) {
        return openvdb::Vec3s(stored(v.rgb.x), stored(v.rgb.y), stored(v.rgb.z));
      });
  builder->grid().setVectorType(openvdb::VEC_INVARIANT);
  builder->grid().insertMeta("colorspace", openvdb::StringMetadata("lin_rec709"));
  return builder;
}

BuilderPtr float_grid(const std::string& name, const std::string& meaning, const Content& content,
                      float bake::Voxel::*member) {
  auto builder = grid_builder<openvdb::FloatGrid>(
      name, content,
      [stored = Stored{content.options.half}, member](const bake::Voxel& v) { return stored(v.*member); });
  builder->grid().insertMeta("meaning", openvdb::StringMetadata(meaning));
  return builder;
}

BuilderPtr density_grid(const Content& content) {
  auto builder = grid_builder<openvdb::FloatGrid>("density", content, [](const bake::Voxel& v) { return v.sigma; });
  builder->grid().insertMeta("meaning", openvdb::StringMetadata("extinction, 1/world unit"));
  return builder;
}

}  // namespace

Affined file_from_world(const VdbOptions& options, const WorldConvention& world) {
  return options.up == "poses" ? Affined{} : turned_up(world.up_axis, options.up);
}

std::string up_axis_of_file(const VdbOptions& options, const WorldConvention& world) {
  return options.up == "poses" ? world.up_axis : options.up;
}

bool density_fits_half(const bake::VolumeStatistics& volume, const VdbOptions& options) {
  if (!options.half || volume.voxels == 0) return options.half;
  return volume.max_sigma <= kHalfMax && volume.min_sigma >= kHalfMinNormal;
}

VdbGrids::VdbGrids(const bake::VolumePlanes& volume, const VdbOptions& options, const Label& label)
    : content_(content_of(volume, options, label)), transform_(transform_of(volume, options, label.world)) {
  const auto color = [](const char* name) { return [name](const Content& c) { return color_grid(name, c); }; };
  const auto scalar = [](const char* name, const char* meaning, float bake::Voxel::*member) {
    return [=](const Content& c) { return float_grid(name, meaning, c, member); };
  };
  const bool half = options.half;
  recipes_ = {{density_grid, density_fits_half(volume.statistics, options)}, {color("color"), half}};
  if (options.houdini) recipes_.push_back({color("Cd"), half});
  recipes_.push_back({scalar("lab_a", "CIE 1976 a, D65", &bake::Voxel::a), half});
  recipes_.push_back({scalar("lab_b", "CIE 1976 b, D65", &bake::Voxel::b), half});
  recipes_.push_back({scalar("luminance", "linear Y", &bake::Voxel::luminance), half});
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
  visit_parts(content_.volume, [&](std::size_t part, const std::vector<bake::Voxel>& voxels) {
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
  const bake::VolumePlanes& volume = content_.volume;
  const VdbOptions& options = content_.options;
  const WorldConvention& world = content_.label.world;
  const bake::Provenance& provenance = content_.label.provenance;
  const SceneFrame& frame = volume.frame;
  openvdb::MetaMap meta;
  meta.insertMeta("cnerf_version", Text(CNERF_VERSION));
  meta.insertMeta("cnerf_world_to_source",
                  openvdb::Mat4DMetadata(row_vector_matrix(file_from_world(options, world).inverse())));
  meta.insertMeta("cnerf_unit_per_world", openvdb::DoubleMetadata(frame.unit_per_world));
  meta.insertMeta("cnerf_world_centre", openvdb::Vec3DMetadata(openvdb::Vec3d(
                                            frame.world_centre.x, frame.world_centre.y, frame.world_centre.z)));
  meta.insertMeta("cnerf_cascades", openvdb::Int32Metadata(frame.cascades));
  meta.insertMeta("cnerf_resolution", openvdb::Vec3IMetadata(openvdb::Vec3i(volume.resolution.x, volume.resolution.y,
                                                                            volume.resolution.z)));
  meta.insertMeta("cnerf_density_scale", openvdb::DoubleMetadata(1));
  meta.insertMeta("units", Text(world.units));
  meta.insertMeta("up_axis", Text(up_axis_of_file(options, world)));
  meta.insertMeta("up_axis_of_the_poses", Text(world.up_axis));
  meta.insertMeta("colorspace", Text("lin_rec709"));
  meta.insertMeta("white", Text("D65"));
  meta.insertMeta("voxel_origin", Text(options.voxel_origin));
  meta.insertMeta("color_origin",
                  Text(provenance.colorizer.empty() ? "grey: not colorized" : "inferred by a colorizer"));
  meta.insertMeta("colorizer", Text(provenance.colorizer));
  meta.insertMeta("take", Text(provenance.take));
  return meta;
}

}  // namespace cnerf::exporting
