#pragma once
/// The OpenVDB grids of a baked volume, made one at a time or all in one pass: what the writers of .vdb and .nvdb files
/// share.

#include <openvdb/openvdb.h>

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "export/vdb_writer.h"

namespace cnerf::exporting {

class VdbGrids {
 public:
  /// @throws ContractError  as write_vdb.
  VdbGrids(const bake::VolumePlanes& volume, const VdbOptions& options, const Label& label);

  [[nodiscard]] std::size_t count() const { return recipes_.size(); }
  /// Whether only one grid should be in memory.
  [[nodiscard]] bool is_sparing() const { return content_.volume.is_sparing; }
  /// One grid with its transform, precision and metadata; names and order as write_vdb says.
  [[nodiscard]] openvdb::GridBase::Ptr make(std::size_t number) const;
  /// The same for all of them. The volume is read once.
  [[nodiscard]] std::vector<openvdb::GridBase::Ptr> make_all() const;
  [[nodiscard]] openvdb::MetaMap file_metadata() const;

  /// Everything about a volume that has to be known before its first voxel is written.
  struct Content {
    bake::VolumePlanes volume;
    bake::VoxelBox box;  ///< of all active voxels
    VdbOptions options;
    Label label;
  };
  /// A grid that is being made, part by part.
  class Builder;

 private:
  /// What makes a grid when its turn comes.
  struct Recipe {
    std::function<std::unique_ptr<Builder>(const Content&)> begin;
    bool half = true;
  };
  [[nodiscard]] std::vector<openvdb::GridBase::Ptr> make(std::span<const Recipe> recipes) const;

  Content content_;
  std::vector<Recipe> recipes_;
  openvdb::math::Transform::Ptr transform_;
};

}  // namespace cnerf::exporting
