#include "export/web_bundle.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "bake/volume/resample.h"
#include "export/manifest.h"
#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/gzip.h"

namespace cnerf::exporting {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

constexpr int kPosterSide = 640;

Json to_json(Vec3d v) {
  return {v.x, v.y, v.z};
}

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

Json volume_json(const WebBricks& bricks) {
  const Json density{{"file", "density.bin"},         {"encoding", "r8"},
                     {"unit", "1/world unit"},        {"formula", "scale * (code / 255)^3"},
                     {"scale", bricks.density_scale}, {"max", bricks.max_density}};
  const Vec3i n = bricks.counts;
  const double side = bricks.voxel_size * kWebBrickSide;
  const Vec3d end = bricks.origin + Vec3d{n.x * side, n.y * side, n.z * side};
  return {{"origin", to_json(bricks.origin)},
          {"voxel_size", bricks.voxel_size},
          {"brick_side", kWebBrickSide},
          {"bricks", {n.x, n.y, n.z}},
          {"stored_bricks", bricks.stored()},
          {"voxels", bricks.voxels},
          {"bounds", {{"min", to_json(bricks.origin)}, {"max", to_json(end)}}},
          {"filter", "differences"},
          {"occupancy", {{"file", "occupancy.bin"}, {"meaning", "bricks to the nearest stored one; 0 = stored"}}},
          {"density", density},
          {"color", {{"file", "color.bin"}, {"encoding", "L* 255/100, a + 128, b + 128; CIE 1976, D65"}}}};
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

/// Of the page's textures.
std::size_t graphics_bytes(const WebBricks& bricks) {
  constexpr std::size_t kTexels = (kWebBrickSide + 2) * (kWebBrickSide + 2) * (kWebBrickSide + 2);  // with neighbours
  return bricks.stored() * kTexels * (2 + 4) + 4 * bricks.distance.size();
}

}  // namespace

WebReport write_web_bundle(const bake::Volume& volume, const WebBricks& bricks, const WebScene& scene,
                           const fs::path& folder, const fs::path& page) {
  CNERF_CHECK(scene.photos.empty() || scene.photos.size() == scene.cameras.size(), "one photograph per camera");
  std::error_code ignored;
  fs::remove(folder / kWebManifest, ignored);  // a manifest never names files of another bundle
  BundleFiles files(folder);
  WebReport report;
  report.volume_bytes += files.add_packed("occupancy.bin", bricks.distance);
  std::vector<std::uint8_t> density = bricks.density, lab = bricks.lab;
  to_differences(density);
  to_differences(lab);
  report.volume_bytes += files.add_packed("density.bin", density);
  report.volume_bytes += files.add_packed("color.bin", lab);

  Json poster(nullptr);
  if (!scene.cameras.empty()) {
    files.add("poster.webp", make_poster(volume, scene.cameras.front(), kPosterSide));
    poster = {{"file", "poster.webp"}, {"camera", 0}};
  }
  for (std::size_t i = 0; i < scene.photos.size(); ++i) {
    if (scene.photos[i].jpeg.empty()) continue;
    report.photo_bytes += files.add(fmt::format("photos/{:03}.jpg", i), scene.photos[i].jpeg);
  }
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
                  {"volume", volume_json(bricks)},
                  {"poster", poster},
                  {"files", files.list()},
                  {"camera_axes", "+X right, +Y down, +Z forward; centre of the first pixel at (0.5, 0.5)"},
                  {"cameras", cameras_json(scene)}};
  report.manifest = folder / kWebManifest;
  write_file(report.manifest, json.dump(1) + "\n");
  return report;
}

void write_web(const bake::Volume& volume, const WebScene& scene, const fs::path& folder, const fs::path& page,
               const WebOptions& options, Observer& observer) {
  const bake::Volume small = resample_volume(volume, options.resolution);
  const WebBricks bricks = make_web_bricks(small);
  const auto mib = [](std::size_t bytes) { return double(bytes) / (1 << 20); };
  observer.say(fmt::format("web: {} x {} x {} voxels, {} bricks; {:.0f} MiB of graphics memory", small.resolution.x,
                           small.resolution.y, small.resolution.z, bricks.stored(), mib(graphics_bytes(bricks))));
  if (page.empty()) {
    observer.say("note: this cnerf was built without the page (CNERF_VIEWER); the bundle holds data only");
  }
  const WebReport report = write_web_bundle(small, bricks, scene, folder, page);
  observer.say(fmt::format("web: {:.2f} MiB of volume, {:.2f} MiB of photographs, {:.0f} KiB of page",
                           mib(report.volume_bytes), mib(report.photo_bytes), double(report.page_bytes) / 1024));
  observer.wrote("web bundle", folder);
}

}  // namespace cnerf::exporting
