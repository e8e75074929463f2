/// A layers model of TensorFlow.js: model.json and its one shard, in two pieces.

#include "src/colorizer/layers_model.h"
#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(layers_model) {
  using namespace cnerf;
  const auto pieces = fuzz::pieces_of(input, 2);
  const auto folder = fuzz::scratch_file("layers/model.json", pieces[0]).parent_path();
  (void)fuzz::scratch_file("layers/shard", pieces[1]);
  fuzz::read_or_refuse(folder, [&] { return read_layers_model(folder); });
}
