/// strokes.json: the list and, where it is taken, what it paints.

#include "src/train/chroma/strokes.h"
#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(strokes) {
  using namespace cnerf;
  const auto file = fuzz::scratch_file("strokes/strokes.json", input);
  const std::vector<std::string> names = {"a", "b"};
  fuzz::read_or_refuse(file, [&] {
    const StrokeList list = read_strokes(file, {names, {"h"}});
    Intrinsics lens;
    lens.width = 16;
    lens.height = 12;
    return painted(list, names, std::vector<Intrinsics>(names.size(), lens));
  });
}
