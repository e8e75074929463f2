/// A file of cameras to render from.

#include "src/render/camera_path.h"
#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(path_file) {
  const auto file = cnerf::fuzz::scratch_file("path.json", input);
  cnerf::fuzz::read_or_refuse(file, [&] { return cnerf::path_from_file(file); });
}
