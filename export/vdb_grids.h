#pragma once
/// The OpenVDB grids of a baked volume, made one at a time: what the writers of .vdb and .nvdb files share.

#include <openvdb/openvdb.h>

#include <functional>
#include <vector>

#include "export/vdb_writer.h"

namespace cnerf {

class VdbGrids {
 public:
  /// @throws ContractError  as write_vdb.
  VdbGrids(const VolumePlanes& volume, const VdbOptions& options);

  [[nodiscard]] std::size_t count() const { return recipes_.size(); }
  /// One grid with its transform, precision and metadata; names and order as write_vdb says.
  [[nodiscard]] openvdb::GridBase::Ptr make(std::size_t number) const;
  [[nodiscard]] openvdb::MetaMap file_metadata() const;

  /// Everything about a volume that has to be known before its first voxel is written.
  struct Content {
    VolumePlanes volume;  ///< dilated
    VolumeStatistics statistics;
    VoxelBox box;  ///< of all active voxels
    VdbOptions options;
  };

 private:
  /// What makes a grid when its turn comes.
  struct Recipe {
    std::function<openvdb::GridBase::Ptr(const Content&)> make;
    bool half = true;
  };

  Content content_;
  std::vector<Recipe> recipes_;
  openvdb::math::Transform::Ptr transform_;
};

}  // namespace cnerf
