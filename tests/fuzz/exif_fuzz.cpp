/// EXIF notes, which are never refused.

#include "src/prepare/exif.h"

#include <cmath>

#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(exif) {
  const cnerf::prepare::ExifFacts facts = cnerf::prepare::read_exif(input);
  const double pixels = cnerf::prepare::focal_pixels(facts, 4000);
  if (facts.orientation < 1 || facts.orientation > 8 || !std::isfinite(pixels) || pixels < 0) {
    throw cnerf::fuzz::Finding("notes that EXIF does not know");
  }
}
