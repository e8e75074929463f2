/// Cameras of other programs, by the first byte: Metashape, RealityCapture's table and sidecars, Polycam, Record3D, and
/// COLMAP's points alone, as text and binary.

#include "src/capture/listing.h"
#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(photogrammetry) {
  using namespace cnerf;
  using namespace std::literals;
  const unsigned kind = fuzz::take_byte(input) % 7;
  const char* names[] = {"cameras.xml",           "table.csv",    "sidecars/a.xmp", "polycam/cameras/a.json",
                         "polycam/metadata.json", "points3D.txt", "points3D.bin"};
  const auto file = fuzz::scratch_file(std::string("other/") + names[kind], input);
  static const auto picture = fuzz::scratch_file(
      "other/sidecars/a.png", fuzz::bytes_of("\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x02\0\0\0\x02\x08\0\0\0\0"sv));
  fuzz::read_or_refuse(file, [&]() -> std::size_t {
    switch (kind) {
      case 0:
        return read_metashape(file).views.size();
      case 1:
        return read_realitycapture_table(file).views.size();
      case 2:
        return read_realitycapture_sidecars(file.parent_path()).views.size();
      case 3:
        return read_polycam(file.parent_path()).views.size();
      case 4:
        return read_record3d(file).views.size();
      default:
        return read_colmap_points(file).size();
    }
  });
}
