/// take.snapshot.

#include "src/train/chroma/color_model.h"
#include "tests/fuzz/snapshot_bytes.h"

CNERF_FUZZ_TARGET(take_snapshot) {
  using namespace cnerf;
  const auto file = fuzz::scratch_file("take.snapshot", fuzz::snapshot_of(input));
  fuzz::read_or_refuse(file, [&] { return ColorModel::load(file, cpu_engines()); });
}
