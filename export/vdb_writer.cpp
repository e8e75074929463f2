#include "export/vdb_writer.h"

#include <openvdb/openvdb.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>

#include "export/vdb_grids.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/parallel.h"

namespace cnerf::exporting {
namespace {

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

  /// Returns where it went.
  Descriptor write_grid(const openvdb::GridBase::ConstPtr& grid, std::ostream& out) const {
    Descriptor descriptor(grid->getName(), grid->type(), grid->saveFloatAsHalf());
    writeGrid(descriptor, grid, out, /*seekable=*/true);
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

}  // namespace

void write_vdb(const bake::VolumePlanes& volume, const std::filesystem::path& path, const VdbOptions& options,
               const Label& label) {
  const VdbGrids grids(volume, options, label);
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

}  // namespace cnerf::exporting
