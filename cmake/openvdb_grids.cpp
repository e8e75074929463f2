// Whether OpenVDB's library holds the grids of bake/volume/openvdb_grids.h: what the program calls of them has to link.
#define CNERF_OPENVDB_HAS_GRIDS 1
#include "bake/volume/openvdb_grids.h"

#include <sstream>

template <typename Grid>
void use() {
  const auto grid = Grid::create();
  std::stringstream stream;
  grid->writeTopology(stream);
  grid->writeBuffers(stream);
  grid->readTopology(stream);
  grid->readBuffers(stream);
  grid->pruneGrid();
  (void)grid->activeVoxelCount();
  (void)grid->evalActiveVoxelBoundingBox();
  (void)grid->tree().activeLeafVoxelCount();
}

int main() {
  use<openvdb::FloatGrid>();
  use<openvdb::Vec3SGrid>();
  openvdb::Int32Tree(-1).clear();
  (void)openvdb::MaskTree(false).activeVoxelCount();
}
