#include "export/nvdb_writer.h"

#include <nanovdb/util/IO.h>
#include <nanovdb/util/OpenToNanoVDB.h>

#include <cerrno>
#include <cstring>
#include <fstream>

#include "export/vdb_grids.h"
#include "src/base/error.h"
#include "src/base/files.h"

namespace cnerf::exporting {
namespace {

/// One of the two kinds of grids that a bake has.
nanovdb::GridHandle<> nano_grid(const openvdb::GridBase::Ptr& grid) {
  const auto scalar = openvdb::gridPtrCast<openvdb::FloatGrid>(grid);
  if (scalar) return nanovdb::openToNanoVDB(*scalar);
  return nanovdb::openToNanoVDB(*openvdb::gridPtrCast<openvdb::Vec3SGrid>(grid));
}

}  // namespace

void write_nvdb(const bake::VolumePlanes& volume, const std::filesystem::path& path, const VdbOptions& options,
                const Label& label) {
  const VdbGrids grids(volume, options, label);
  write_atomically(path, [&](const std::filesystem::path& temporary) {
    errno = 0;
    std::ofstream out(temporary, std::ios::binary | std::ios::trunc);
    for (std::size_t number = 0; out && number < grids.count(); ++number) {
      nanovdb::io::writeGrid(out, nano_grid(grids.make(number)));
    }
    out.close();
    if (!out) throw OutputError(path.string() + ": cannot be written: " + std::strerror(errno));
  });
}

}  // namespace cnerf::exporting
