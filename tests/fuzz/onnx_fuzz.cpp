/// A network in the ONNX format, as OpenCV reads it behind our check of its tensors.

#include "src/colorizer/kinds.h"
#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(onnx) {
  using namespace cnerf;
  const auto file = fuzz::scratch_file("net.onnx", input);
  const ColorizerOptions options;
  const ColorizerContext context;
  fuzz::read_or_refuse(file, [&] { return make_onnx_colorizer({file.string(), options, context}); });
}
