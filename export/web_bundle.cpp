#include "export/web_bundle.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "bake/volume/dilate.h"
#include "bake/volume/resample.h"
#include "export/manifest.h"
#include "export/vec3_json.h"
#include "export/web_levels.h"
#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/gzip.h"
#include "src/base/json.h"
#include "src/picture/encode.h"

namespace cnerf::exporting {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

constexpr int kPosterSide = 640;
constexpr int kSkyQuality = 92;  // of JPEG

/// Writes the files of a bundle and remembers what its manifest says of them.
class BundleFiles {
 public:
  explicit BundleFiles(fs::path folder) : folder_(std::move(folder)) {}

  std::size_t add(const std::string& name, std::span<const std::byte> content, std::size_t raw_bytes = 0) {
    write_file(folder_ / name, content);
    Json entry{{"name", name}, {"bytes", content.size()}, {"sha256", sha256(content)}};
    if (raw_bytes > 0) entry["raw_bytes"] = raw_bytes;
    list_.push_back(entry);
    return content.size();
  }
  std::size_t add_packed(const std::string& name, const std::vector<std::uint8_t>& bytes) {
    return add(name, gzip(bytes), bytes.size());
  }
  [[nodiscard]] const Json& list() const { return list_; }
  /// Removes those of another bundle that this one does not have.
  void remove_others(const std::vector<std::string>& former) const {
    for (const std::string& name : former) {
      const bool is_ours = std::ranges::any_of(list_, [&](const Json& entry) { return entry["name"] == name; });
      const auto other = file_below(folder_, name);  // a bundle may come from anybody
      if (!is_ours && other) remove_output(*other);
    }
  }

 private:
  fs::path folder_;
  Json list_ = Json::array();
};

std::size_t copy_page(const fs::path& page, const fs::path& folder) {
  if (!fs::exists(page / "index.html")) {
    throw MissingInputError(page.string() + ": holds no built page (index.html); build the target cnerf_viewer_page");
  }
  std::size_t bytes = 0;
  for (const auto& entry : fs::recursive_directory_iterator(page)) {
    if (!entry.is_regular_file()) continue;
    const std::vector<std::byte> content = read_binary_file(entry.path());
    write_file(folder / fs::relative(entry.path(), page), content);
    bytes += content.size();
  }
  return bytes;
}

/// File of a level, by the names that bake_folder.h has for grids: density.bin, density_fine1.bin.
std::string part_name(const std::string& part, std::size_t level) {
  return level == 0 ? part + ".bin" : fmt::format("{}_fine{}.bin", part, level);
}

constexpr const char* kParts[] = {"occupancy", "density", "color"};

Json level_json(const WebBricks& bricks, std::size_t level) {
  const Json density{{"file", part_name("density", level)},
                     {"encoding", "r8"},
                     {"unit", "1/world unit"},
                     {"formula", "scale * (code / 255)^3"},
                     {"scale", bricks.density_scale},
                     {"max", bricks.max_density}};
  const Vec3i n = bricks.counts;
  const Vec3d end = bricks.origin + (n * kWebBrickSide).cast<double>() * bricks.voxel_size;
  return {
      {"origin", bricks.origin},
      {"voxel_size", bricks.voxel_size},
      {"brick_side", kWebBrickSide},
      {"bricks", n},
      {"stored_bricks", bricks.stored()},
      {"voxels", bricks.voxels},
      {"bounds", Aabbd{bricks.origin, end}},
      {"cover", bricks.cover},
      {"filter", "differences"},
      {"occupancy",
       {{"file", part_name("occupancy", level)}, {"meaning", "bricks to the nearest stored one; 0 = stored"}}},
      {"density", density},
      {"color", {{"file", part_name("color", level)}, {"encoding", "L* 255/100, a + 128, b + 128; CIE 1976, D65"}}}};
}

Json levels_json(const std::vector<WebBricks>& levels) {
  Json list = Json::array();
  for (std::size_t level = 0; level < levels.size(); ++level) list.push_back(level_json(levels[level], level));
  return list;
}

/// @return bytes written.
std::size_t add_level(const WebBricks& bricks, std::size_t level, BundleFiles& files) {
  std::vector<std::uint8_t> density = bricks.density, lab = bricks.lab;
  to_differences(density);
  to_differences(lab);
  return files.add_packed(part_name("occupancy", level), bricks.distance) +
         files.add_packed(part_name("density", level), density) + files.add_packed(part_name("color", level), lab);
}

/// Those of a bundle that had more levels.
void remove_levels_from(std::size_t level, const fs::path& folder) {
  for (bool any = true; any; ++level) {
    any = false;
    for (const char* part : kParts) {
      const fs::path file = folder / part_name(part, level);
      any = fs::exists(file) || any;
      remove_output(file);
    }
  }
}

/// Files that a bundle lists; none where it is not there or not a bundle.
std::vector<std::string> files_of_bundle(const fs::path& manifest) {
  std::vector<std::string> files;
  try {
    const Json bundle = read_json(manifest);
    for (const Json& file : bundle.at("files")) files.push_back(file.at("name").get<std::string>());
  } catch (const std::exception&) {
  }
  return files;
}

Json cameras_json(const WebScene& scene) {
  Json cameras = Json::array();
  for (std::size_t i = 0; i < scene.cameras.size(); ++i) {
    Json camera = camera_json(scene.cameras[i]);
    const bool has_photo = !scene.photos.empty() && !scene.photos[i].jpeg.empty();
    camera["photo"] = has_photo ? Json(fmt::format("photos/{:03}.jpg", i)) : Json(nullptr);
    cameras.push_back(camera);
  }
  return cameras;
}

/// What the page takes: viewer/src/bundle.ts.
constexpr std::size_t kMostStoredBricks = std::size_t(1) << 18;

void refuse_too_many_bricks(const std::vector<WebBricks>& levels) {
  std::size_t stored = 0;
  for (const WebBricks& level : levels) stored += level.stored();
  if (stored <= kMostStoredBricks) return;
  throw UsageError(fmt::format("web.resolution: {} bricks of 8^3 voxels hold something, and a page takes {}; lower it",
                               stored, kMostStoredBricks));
}

double mib(std::size_t bytes) {
  return double(bytes) / (1 << 20);
}

/// Of the page's textures.
std::size_t graphics_bytes(const WebBricks& bricks) {
  constexpr std::size_t kTexels = (kWebBrickSide + 2) * (kWebBrickSide + 2) * (kWebBrickSide + 2);  // with neighbours
  return bricks.stored() * kTexels * (2 + 4) + 4 * bricks.distance.size();
}

}  // namespace

WebReport write_web_bundle(const WebVolume& volume, const WebScene& scene, const fs::path& folder,
                           const fs::path& page) {
  CNERF_CHECK(!volume.levels.empty(), "a bundle has a level");
  CNERF_CHECK(scene.photos.empty() || scene.photos.size() == scene.cameras.size(), "one photograph per camera");
  const std::vector<std::string> former = files_of_bundle(folder / kWebManifest);
  std::error_code ignored;
  fs::remove(folder / kWebManifest, ignored);  // a manifest never names files of another bundle
  BundleFiles files(folder);
  WebReport report;
  for (std::size_t level = 0; level < volume.levels.size(); ++level) {
    report.volume_bytes += add_level(volume.levels[level], level, files);
  }
  remove_levels_from(volume.levels.size(), folder);

  Json poster(nullptr);
  if (!volume.poster.empty()) {
    files.add("poster.webp", volume.poster);
    poster = {{"file", "poster.webp"}, {"camera", 0}};
  }
  Json sky(nullptr);
  if (scene.sky) {
    const Picture picture = picture_from_linear(scene.sky->width, scene.sky->height, scene.sky->rgb);
    files.add("sky.jpg", jpeg_bytes(picture, kSkyQuality));
    sky = {{"file", "sky.jpg"}, {"layout", "equirectangular: +x in the middle, +z up, +y a quarter to the left; sRGB"}};
  }
  for (std::size_t i = 0; i < scene.photos.size(); ++i) {
    if (scene.photos[i].jpeg.empty()) continue;
    report.photo_bytes += files.add(fmt::format("photos/{:03}.jpg", i), scene.photos[i].jpeg);
  }
  files.remove_others(former);  // a folder that is uploaded shows nothing that was left out
  if (!page.empty()) report.page_bytes = copy_page(page, folder);

  const Json json{{"schema", kWebSchema},
                  {"program", "cnerf"},
                  {"program_version", CNERF_VERSION},
                  {"title", scene.title},
                  {"command_line", scene.label.provenance.command_line},
                  {"units", scene.label.world.units},
                  {"up_axis", scene.label.world.up_axis},
                  {"color", color_json(scene.label.provenance)},
                  {"frame", frame_json(volume.frame)},
                  {"levels", levels_json(volume.levels)},
                  {"poster", poster},
                  {"sky", sky},
                  {"files", files.list()},
                  {"camera_axes", "+X right, +Y down, +Z forward; centre of the first pixel at (0.5, 0.5)"},
                  {"cameras", cameras_json(scene)}};
  report.manifest = folder / kWebManifest;
  write_file(report.manifest, json.dump(1) + "\n");
  return report;
}

/// What a camera sees of nested grids that are at most as fine as the page's levels.
std::vector<std::byte> poster_of(const std::vector<bake::Volume>& volumes, const bake::Camera& camera, int resolution) {
  std::vector<bake::Volume> small;
  for (const bake::Volume& volume : volumes) {
    const Vec3i n = volume.resolution;
    if (volume.voxels.empty()) continue;
    small.push_back(resample_volume(volume, resolution));
    if (std::max({n.x, n.y, n.z}) > resolution) dilate_colors(small.back(), 1);
  }
  return make_poster(small, camera, kPosterSide);
}

WebVolume make_web_volume(std::vector<bake::Volume> volumes, const std::vector<bake::Camera>& cameras,
                          const WebOptions& options, Observer& observer) {
  WebVolume volume;
  CNERF_CHECK(!volumes.empty(), "a bake has a grid");
  volume.frame = volumes.back().frame;
  if (!cameras.empty()) volume.poster = poster_of(volumes, cameras.front(), options.resolution);
  volume.levels = make_web_levels(std::move(volumes), options.resolution);
  refuse_too_many_bricks(volume.levels);
  for (const WebBricks& bricks : volume.levels) {
    observer.say(fmt::format("web: {:.1f} M voxels of {:.4g} in {} bricks; {:.0f} MiB of graphics memory",
                             1e-6 * double(bricks.voxels), bricks.voxel_size, bricks.stored(),
                             mib(graphics_bytes(bricks))));
  }
  return volume;
}

void write_web(const WebVolume& volume, const WebScene& scene, const fs::path& folder, const fs::path& page,
               Observer& observer) {
  if (page.empty()) {
    observer.say("note: this cnerf was built without the page (CNERF_VIEWER); the bundle holds data only");
  }
  const WebReport report = write_web_bundle(volume, scene, folder, page);
  observer.say(fmt::format("web: {:.2f} MiB of volume, {:.2f} MiB of photographs, {:.0f} KiB of page",
                           mib(report.volume_bytes), mib(report.photo_bytes), double(report.page_bytes) / 1024));
  observer.wrote("web bundle", folder);
}

void write_web(std::vector<bake::Volume> volumes, const WebScene& scene, const fs::path& folder, const fs::path& page,
               const WebOptions& options, Observer& observer) {
  write_web(make_web_volume(std::move(volumes), scene.cameras, options, observer), scene, folder, page, observer);
}

}  // namespace cnerf::exporting
