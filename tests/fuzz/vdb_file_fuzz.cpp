/// A VDB file, read by the program of its own that does so: slow, since each input starts it twice.

#include "export/vdb_reader.h"
#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(vdb_file) {
  using namespace cnerf;
  const auto file = fuzz::scratch_file("volume.vdb", input);
  fuzz::read_or_refuse(file, [&] { return exporting::summarize_vdb(file); });
  fuzz::read_or_refuse(file, [&] { return exporting::read_vdb(file); });
}
