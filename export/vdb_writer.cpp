#include "export/vdb_writer.h"

#include <openvdb/openvdb.h>

#include <cerrno>
#include <cstring>
#include <fstream>

#include "export/vdb_grids.h"
#include "src/base/error.h"
#include "src/base/files.h"

namespace cnerf {
namespace {

std::uint32_t compression_flags(const std::string& name) {
  if (name == "none") return openvdb::io::COMPRESS_ACTIVE_MASK;
  if (name == "zip" || !openvdb::io::Archive::hasBloscCompression()) {
    return openvdb::io::COMPRESS_ZIP | openvdb::io::COMPRESS_ACTIVE_MASK;
  }
  return openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK;
}

/// What openvdb::io::File writes, but grid after grid, so that only one is in memory, and to a stream whose failures
/// are seen: File leaves a cut-off file on a full disk and says nothing.
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
    const auto count = static_cast<std::int32_t>(grids.count());
    out.write(reinterpret_cast<const char*>(&count), sizeof count);
    for (std::size_t number = 0; number < grids.count(); ++number) {
      const openvdb::GridBase::Ptr grid = grids.make(number);
      openvdb::io::GridDescriptor descriptor(grid->getName(), grid->type(), grid->saveFloatAsHalf());
      writeGrid(descriptor, grid, out, /*seekable=*/true);
    }
    out.close();
  }
};

}  // namespace

void write_vdb(const VolumePlanes& volume, const std::filesystem::path& path, const VdbOptions& options) {
  const VdbGrids grids(volume, options);
  write_atomically(path, [&](const std::filesystem::path& temporary) {
    try {
      CheckedArchive(compression_flags(options.compression)).save(temporary, grids);
    } catch (const std::ios::failure& failure) {
      throw OutputError(path.string() + ": cannot be written: " + (errno != 0 ? std::strerror(errno) : failure.what()));
    } catch (const openvdb::Exception& failure) {
      throw OutputError(path.string() + ": cannot be written: " + failure.what());
    }
  });
}

void write_vdb(const BakedVolume& volume, const std::filesystem::path& path, const VdbOptions& options) {
  write_vdb(planes_of(volume), path, options);
}

}  // namespace cnerf
