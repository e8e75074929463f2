/// cameras.txt, images.txt and points3D.txt: the input in three pieces.

#include "src/capture/listing.h"
#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(colmap_text) {
  using namespace cnerf::fuzz;
  const auto pieces = pieces_of(input, 3);
  const char* names[] = {"text/cameras.txt", "text/images.txt", "text/points3D.txt"};
  for (std::size_t i = 0; i < 3; ++i) (void)scratch_file(names[i], pieces[i]);
  const auto folder = scratch_folder() / "text";
  read_or_refuse(folder, [&] { return cnerf::read_colmap(scratch_folder(), folder); });
  read_or_refuse(folder, [&] { return cnerf::colmap_image_count(folder); });
}
