/// Options that name colours: a palette, hints and a file of strokes that name its words, in three pieces.

#include "src/pipeline/known_color_files.h"
#include "tests/fuzz/fuzz_target.h"

namespace {

using namespace std::literals;

cnerf::Capture small_capture() {
  const auto picture = cnerf::fuzz::scratch_file(
      "words/a.png", cnerf::fuzz::bytes_of("\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x08\0\0\0\x08\x08\0\0\0\0"sv));
  cnerf::Capture capture;
  for (const char* name : {"a", "b", "h"}) {
    cnerf::View view;
    view.name = name;
    view.image_file = picture;
    view.intrinsics.width = view.intrinsics.height = 8;
    view.held_out = view.name == "h";
    capture.views.push_back(view);
  }
  return capture;
}

}  // namespace

CNERF_FUZZ_TARGET(known_colors) {
  using namespace cnerf;
  static const Capture capture = small_capture();
  const auto pieces = fuzz::pieces_of(input, 3);
  ColorizerOptions options;
  options.palette = fuzz::text_of(pieces[0]);
  options.hints = fuzz::text_of(pieces[1]);
  if (!pieces[2].empty()) options.strokes = fuzz::scratch_file("words/strokes.json", pieces[2]).string();
  try {
    (void)pipeline::load_known_colors(capture, options);
  } catch (const Error& refusal) {
    if (std::string_view(refusal.what()).empty()) throw fuzz::Finding("a refusal says nothing");
  }
}
