/// stage1.snapshot.

#include "src/train/luminance/luminance_model.h"
#include "tests/fuzz/snapshot_bytes.h"

CNERF_FUZZ_TARGET(stage1_snapshot) {
  using namespace cnerf;
  const auto file = fuzz::scratch_file("stage1.snapshot", fuzz::snapshot_of(input));
  fuzz::read_or_refuse(file, [&] { return LuminanceModel::options_in(file); });
  fuzz::read_or_refuse(file, [&] { return LuminanceModel::load(file, cpu_engines()); });
}
