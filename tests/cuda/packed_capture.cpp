#include "tests/cuda/packed_capture.h"

#include <cstdio>
#include <fstream>

#include "src/base/error.h"

namespace cnerf::test {
namespace fs = std::filesystem;
namespace {

constexpr std::uint32_t kMagic = 0x33504e43;  // CNP3

template <typename T>
void put(std::ofstream& file, const T& value) {
  file.write(reinterpret_cast<const char*>(&value), sizeof(T));
}
template <typename T>
void get(std::ifstream& file, T& value) {
  file.read(reinterpret_cast<char*>(&value), sizeof(T));
}

fs::path plane_file(const fs::path& folder, std::size_t view, const char* extension) {
  char name[16];
  std::snprintf(name, sizeof(name), "%04zu.", view);
  return folder / (std::string(name) + extension);
}
void write_plane(const fs::path& file, const PixelPlane<std::uint8_t>& plane) {
  std::ofstream(file, std::ios::binary).write(reinterpret_cast<const char*>(plane.data()), long(plane.size()));
}
std::vector<std::uint8_t> read_plane(const fs::path& file, std::size_t size) {
  std::vector<std::uint8_t> plane(size);
  std::ifstream stream(file, std::ios::binary);
  stream.read(reinterpret_cast<char*>(plane.data()), long(size));
  if (!stream) throw MissingInputError(file.string() + ": missing or too short");
  return plane;
}

}  // namespace

void write_packed(const PackedCapture& packed, const fs::path& folder) {
  fs::create_directories(folder);
  std::ofstream file(folder / "scene.bin", std::ios::binary);
  put(file, kMagic);
  put(file, packed.frame);
  put(file, packed.occupancy_resolution);
  put(file, std::uint64_t(packed.excluded.size()));
  file.write(reinterpret_cast<const char*>(packed.excluded.data()), long(packed.excluded.size()));
  put(file, std::uint64_t(packed.truth.size()));
  for (const Affined& pose : packed.truth) put(file, pose);
  put(file, std::uint64_t(packed.capture.points.size()));
  for (const SparsePoint& point : packed.capture.points) {
    put(file, point.position);
    put(file, point.error);
    put(file, std::uint32_t(point.views.size()));
    for (const std::uint32_t view : point.views) put(file, view);
  }
  put(file, std::uint32_t(packed.capture.views.size()));
  for (std::size_t v = 0; v < packed.capture.views.size(); ++v) {
    const View& view = packed.capture.views[v];
    put(file, view.intrinsics);
    put(file, view.world_from_camera);
    put(file, view.held_out);
    put(file, view.image.transfer);
    put(file, !view.image.alpha.empty());
    put(file, !view.image.mask.empty());
    write_plane(plane_file(folder, v, "grey"), view.image.u8);
    if (!view.image.alpha.empty()) write_plane(plane_file(folder, v, "alpha"), view.image.alpha);
    if (!view.image.mask.empty()) write_plane(plane_file(folder, v, "mask"), view.image.mask);
  }
  if (!file) throw OutputError((folder / "scene.bin").string() + ": cannot be written");
}

PackedCapture read_packed(const fs::path& folder) {
  std::ifstream file(folder / "scene.bin", std::ios::binary);
  std::uint32_t magic = 0, views = 0;
  std::uint64_t cells = 0;
  PackedCapture packed;
  get(file, magic);
  if (!file || magic != kMagic) throw InputError(folder.string() + ": no packed capture");
  get(file, packed.frame);
  get(file, packed.occupancy_resolution);
  get(file, cells);
  packed.excluded.resize(cells);
  file.read(reinterpret_cast<char*>(packed.excluded.data()), long(cells));
  std::uint64_t poses = 0, points = 0;
  get(file, poses);
  for (std::uint64_t p = 0; p < poses && file; ++p) get(file, packed.truth.emplace_back());
  get(file, points);
  for (std::uint64_t p = 0; p < points && file; ++p) {
    SparsePoint point;
    std::uint32_t shown = 0;
    get(file, point.position);
    get(file, point.error);
    get(file, shown);
    point.views.resize(shown);
    for (std::uint32_t& view : point.views) get(file, view);
    packed.capture.points.push_back(std::move(point));
  }
  get(file, views);
  for (std::size_t v = 0; v < views; ++v) {
    View view;
    bool has_alpha = false, has_mask = false;
    get(file, view.intrinsics);
    get(file, view.world_from_camera);
    get(file, view.held_out);
    get(file, view.image.transfer);
    get(file, has_alpha);
    get(file, has_mask);
    view.image.width = view.intrinsics.width;
    view.image.height = view.intrinsics.height;
    view.image.u8 = read_plane(plane_file(folder, v, "grey"), view.image.pixel_count());
    if (has_alpha) view.image.alpha = read_plane(plane_file(folder, v, "alpha"), view.image.pixel_count());
    if (has_mask) view.image.mask = read_plane(plane_file(folder, v, "mask"), view.image.pixel_count());
    packed.capture.views.push_back(std::move(view));
  }
  if (!file) throw InputError(folder.string() + ": scene.bin is cut short");
  return packed;
}

}  // namespace cnerf::test
