#include "export/vdb_writer.h"

#include <nanovdb/util/IO.h>
#include <nanovdb/util/OpenToNanoVDB.h>
#include <openvdb/tools/Prune.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <functional>
#include <memory>
#include <span>
#include <sstream>
#include <vector>

#include "bake/volume/openvdb_grids.h"
#include "export/up_axis.h"
#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/parallel.h"

namespace cnerf::exporting {
namespace {

constexpr int kPadding = 1;  ///< voxels of zeros around what is active
constexpr float kHalfMax = 65504.0f;
constexpr float kHalfMinNormal = 0x1p-14f;  ///< below it a half loses digits

/// Everything about a volume that has to be known before its first voxel is written.
struct Content {
  bake::VolumePlanes volume;
  bake::VoxelBox box;  ///< of all active voxels
  VdbOptions options;
  Label label;
};

/// A grid that is being made, part by part.
class Builder {
 public:
  Builder() = default;
  virtual ~Builder() = default;
  Builder(const Builder&) = delete;
  Builder& operator=(const Builder&) = delete;

  /// Of one part of the volume; parts may be added at the same time.
  virtual void add(std::size_t part, std::span<const bake::Voxel> voxels) = 0;
  [[nodiscard]] virtual openvdb::GridBase::Ptr finish() = 0;
};

using BuilderPtr = std::unique_ptr<Builder>;

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
class GridBuilder final : public Builder {
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
    for (const Vec3i corner : {box_.low, box_.high - Vec3i{1, 1, 1}}) {
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

/// Keeps values finite in the 16 bits that a file stores.
float in_half(float value) {
  return std::clamp(value, -kHalfMax, kHalfMax);
}

BuilderPtr color_grid(const std::string& name, const Content& content) {
  auto builder = grid_builder<openvdb::Vec3SGrid>(name, content, [](const bake::Voxel& v) {
    return openvdb::Vec3s(in_half(v.rgb.x), in_half(v.rgb.y), in_half(v.rgb.z));
  });
  builder->grid().setVectorType(openvdb::VEC_INVARIANT);
  builder->grid().insertMeta("colorspace", openvdb::StringMetadata("lin_rec709"));
  return builder;
}

BuilderPtr float_grid(const std::string& name, const std::string& meaning, const Content& content,
                      float bake::Voxel::*member) {
  auto builder =
      grid_builder<openvdb::FloatGrid>(name, content, [member](const bake::Voxel& v) { return in_half(v.*member); });
  builder->grid().insertMeta("meaning", openvdb::StringMetadata(meaning));
  return builder;
}

BuilderPtr density_grid(const Content& content) {
  auto builder = grid_builder<openvdb::FloatGrid>("density", content, [](const bake::Voxel& v) { return v.sigma; });
  builder->grid().insertMeta("meaning", openvdb::StringMetadata("extinction, 1/world unit"));
  return builder;
}

/// The OpenVDB grids of a baked volume, made one at a time or all in one pass.
class VdbGrids {
 public:
  /// @throws ContractError  as write_vdb.
  VdbGrids(const bake::VolumePlanes& volume, const VdbOptions& options, const Label& label);

  [[nodiscard]] std::size_t count() const { return recipes_.size(); }
  /// Whether only one grid should be in memory.
  [[nodiscard]] bool is_sparing() const { return content_.volume.is_sparing; }
  /// One grid with its transform, precision and metadata; names and order as write_vdb says.
  [[nodiscard]] openvdb::GridBase::Ptr make(std::size_t number) const {
    return make(std::span(recipes_).subspan(number, 1)).front();
  }
  /// The same for all of them. The volume is read once.
  [[nodiscard]] std::vector<openvdb::GridBase::Ptr> make_all() const { return make(std::span(recipes_)); }
  [[nodiscard]] openvdb::MetaMap file_metadata() const;

 private:
  /// What makes a grid when its turn comes.
  struct Recipe {
    std::function<BuilderPtr(const Content&)> begin;
    bool half = true;
  };
  [[nodiscard]] std::vector<openvdb::GridBase::Ptr> make(std::span<const Recipe> recipes) const;

  Content content_;
  std::vector<Recipe> recipes_;
  openvdb::math::Transform::Ptr transform_;
};

VdbGrids::VdbGrids(const bake::VolumePlanes& volume, const VdbOptions& options, const Label& label)
    : content_(content_of(volume, options, label)), transform_(transform_of(volume, options, label.world)) {
  const auto color = [](const char* name) { return [name](const Content& c) { return color_grid(name, c); }; };
  const auto scalar = [](const char* name, const char* meaning, float bake::Voxel::*member) {
    return [=](const Content& c) { return float_grid(name, meaning, c, member); };
  };
  recipes_ = {{density_grid, density_fits_half(volume.statistics)}, {color("color")}};
  if (options.houdini) recipes_.push_back({color("Cd")});
  recipes_.push_back({scalar("lab_a", "CIE 1976 a, D65", &bake::Voxel::a)});
  recipes_.push_back({scalar("lab_b", "CIE 1976 b, D65", &bake::Voxel::b)});
  recipes_.push_back({scalar("luminance", "linear Y", &bake::Voxel::luminance)});
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

std::uint32_t compression_flags(const std::string& name) {
  if (name == "none") return openvdb::io::COMPRESS_ACTIVE_MASK;
  if (name == "zip" || !openvdb::io::Archive::hasBloscCompression()) {
    return openvdb::io::COMPRESS_ZIP | openvdb::io::COMPRESS_ACTIVE_MASK;
  }
  return openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK;
}

/// What openvdb::io::File writes, but to a stream whose failures are seen (File leaves a cut-off file on a full disk
/// and says nothing), and either grid after grid, so that only one is in memory, or all of them at the same time.
class CheckedArchive : public openvdb::io::Archive {
 public:
  explicit CheckedArchive(std::uint32_t compression) { setCompression(compression); }

  void save(const std::filesystem::path& file, const VdbGrids& grids) const {
    errno = 0;
    std::ofstream out;
    out.exceptions(std::ios::failbit | std::ios::badbit);
    out.open(file, std::ios::binary | std::ios::trunc);
    writeHeader(out, /*seekable=*/true);
    grids.file_metadata().writeMeta(out);
    const auto count = std::int32_t(grids.count());
    out.write(reinterpret_cast<const char*>(&count), sizeof count);
    if (grids.is_sparing()) {
      for (std::size_t number = 0; number < grids.count(); ++number) write_grid(grids.make(number), out);
    } else {
      write_together(grids.make_all(), out);
    }
    out.close();
  }

 private:
  using Descriptor = openvdb::io::GridDescriptor;

  /// As Archive::writeGrid, which leaves zip out for fog volumes.  @return  where it went
  Descriptor write_grid(const openvdb::GridBase::Ptr& grid, std::ostream& out) const {
    Descriptor descriptor(grid->getName(), grid->type(), grid->saveFloatAsHalf());
    descriptor.writeHeader(out);
    const auto positions = out.tellp();
    descriptor.writeStreamPos(out);  // room for them
    descriptor.setGridPos(out.tellp());
    const std::uint32_t flags = compression();
    openvdb::io::setDataCompression(out, flags);
    out.write(reinterpret_cast<const char*>(&flags), sizeof flags);
    grid->addStatsMetadata();  // for readers that have no room for the grid
    grid->writeMeta(out);
    grid->writeTransform(out);
    grid->writeTopology(out);
    descriptor.setBlockPos(out.tellp());
    grid->writeBuffers(out);
    descriptor.setEndPos(out.tellp());
    out.seekp(positions);
    descriptor.writeStreamPos(out);
    descriptor.seekToEnd(out);
    return descriptor;
  }

  /// Compressing takes longest, so each grid is written to a memory of its own, by a thread of its own.
  void write_together(std::vector<openvdb::GridBase::Ptr> grids, std::ostream& out) const {
    std::vector<std::ostringstream> written(grids.size());
    std::vector<Descriptor> descriptors(grids.size());
    parallel_tasks(grids.size(), [&](std::size_t g) {
      written[g].exceptions(std::ios::failbit | std::ios::badbit);  // where memory does not suffice as well
      descriptors[g] = write_grid(grids[g], written[g]);
      grids[g].reset();
    });
    for (std::size_t g = 0; g < written.size(); ++g) {
      const std::streamoff begin = out.tellp();
      const std::string_view bytes = written[g].view();
      out.write(bytes.data(), std::streamsize(bytes.size()));
      move_descriptor(descriptors[g], begin, out);
      out.seekp(0, std::ios::end);
      written[g] = {};
    }
  }

  /// A grid says where its pieces lie, counted from the start of the file.
  static void move_descriptor(Descriptor descriptor, std::streamoff begin, std::ostream& out) {
    std::ostringstream header;
    descriptor.writeHeader(header);
    descriptor.setGridPos(descriptor.getGridPos() + begin);
    descriptor.setBlockPos(descriptor.getBlockPos() + begin);
    descriptor.setEndPos(descriptor.getEndPos() + begin);
    out.seekp(begin + std::streamoff(header.str().size()));
    descriptor.writeStreamPos(out);
  }
};

/// One of the two kinds of grids that a bake has.
nanovdb::GridHandle<> nano_grid(const openvdb::GridBase::Ptr& grid) {
  const auto scalar = openvdb::gridPtrCast<openvdb::FloatGrid>(grid);
  if (scalar) return nanovdb::openToNanoVDB(*scalar);
  return nanovdb::openToNanoVDB(*openvdb::gridPtrCast<openvdb::Vec3SGrid>(grid));
}

/// @throws OutputError  naming `path` for what streams and OpenVDB throw
void write_volume(const std::filesystem::path& path,
                  const std::function<void(const std::filesystem::path& temporary)>& write) {
  write_atomically(path, [&](const std::filesystem::path& temporary) {
    errno = 0;
    try {
      write(temporary);
    } catch (const std::ios::failure& failure) {
      throw OutputError(path.string() + ": cannot be written: " + (errno != 0 ? std::strerror(errno) : failure.what()));
    } catch (const openvdb::Exception& failure) {
      throw OutputError(path.string() + ": cannot be written: " + failure.what());
    }
  });
}

}  // namespace

Affined file_from_world(const VdbOptions& options, const WorldConvention& world) {
  return options.up == "poses" ? Affined{} : turned_up(world.up_axis, options.up);
}

std::string up_axis_of_file(const VdbOptions& options, const WorldConvention& world) {
  return options.up == "poses" ? world.up_axis : options.up;
}

bool density_fits_half(const bake::VolumeStatistics& volume) {
  return volume.voxels == 0 || (volume.max_sigma <= kHalfMax && volume.min_sigma >= kHalfMinNormal);
}

void write_vdb(const bake::VolumePlanes& volume, const std::filesystem::path& path, const VdbOptions& options,
               const Label& label) {
  const VdbGrids grids(volume, options, label);
  write_volume(path, [&](const std::filesystem::path& temporary) {
    CheckedArchive(compression_flags(options.compression)).save(temporary, grids);
  });
}

void write_nvdb(const bake::VolumePlanes& volume, const std::filesystem::path& path, const VdbOptions& options,
                const Label& label) {
  const VdbGrids grids(volume, options, label);
  write_volume(path, [&](const std::filesystem::path& temporary) {
    std::ofstream out;
    out.exceptions(std::ios::failbit | std::ios::badbit);  // before the library finds out and says less
    out.open(temporary, std::ios::binary | std::ios::trunc);
    for (std::size_t number = 0; number < grids.count(); ++number) {
      nanovdb::io::writeGrid(out, nano_grid(grids.make(number)));
    }
    out.close();
  });
}

}  // namespace cnerf::exporting
