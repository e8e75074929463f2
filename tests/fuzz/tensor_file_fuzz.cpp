/// Named tensors: the text of their names, shapes and offsets, then the values.

#include "src/base/tensor_file.h"

#include <numeric>

#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(tensor_file) {
  using namespace cnerf;
  const auto pieces = fuzz::pieces_of(input, 2);
  (void)fuzz::scratch_file("tensors.txt", pieces[0]);
  const auto file = fuzz::scratch_file("tensors.bin", pieces[1]);
  fuzz::read_or_refuse(file.parent_path() / "tensors", [&] {
    const TensorFile tensors(file);
    const auto values = tensors.get("weight").values;
    volatile float sum = std::accumulate(values.begin(), values.end(), 0.0f);
    (void)sum;
  });
}
