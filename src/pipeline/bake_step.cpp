#include "src/pipeline/bake_step.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <span>
#include <sstream>

#include "bake/bake_estimate.h"
#include "bake/dilate.h"
#include "bake/mesh/mesh_baker.h"
#include "bake/resample.h"
#include "bake/volume_baker.h"
#include "export/bake_folder.h"
#include "export/manifest_json.h"
#include "src/base/byte_count.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/parallel.h"
#include "src/config/fields.h"
#include "src/config/toml_binding.h"
#include "src/pipeline/version.h"
#include "viewer/server/page_folder.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;
namespace {

void say_estimate(const std::vector<BakePlan>& plans, const BakeEstimate& estimate, Observer& observer) {
  for (const BakePlan& plan : plans) {
    observer.say(fmt::format("bake: {} x {} x {} voxels of {:.4g}", plan.resolution.x, plan.resolution.y,
                             plan.resolution.z, plan.voxel_size));
  }
  observer.say(
      fmt::format("bake: about {:.1f} M of them hold something; beside the {} held now, {} of memory to find what "
                  "cameras see of them and at most {} to write it; {} of disk",
                  1e-6 * double(estimate.voxels), in_words(held_memory_bytes()), in_words(estimate.memory_bytes),
                  in_words(estimate.writing_bytes), in_words(estimate.disk_bytes)));
  observer.say(fmt::format("bake: Cycles will take about {} for them", in_words(cycles_bytes(plans))));
}

/// All that a bake's voxels depend on: what differs in any of it does not continue another.
std::string bake_identity(const RunDirectory& directory, const std::string& take,
                          const std::vector<BakeCamera>& cameras, const std::vector<BakePlan>& plans,
                          BakeOptions options) {
  options.max_memory.clear();  // a bake may go on with more of it
  std::ostringstream identity;
  identity << "cnerf " << version_text() << '\n' << sha256_of_file(directory.stage1_snapshot()) << '\n';
  if (!take.empty()) identity << sha256_of_file(directory.take_snapshot(take)) << '\n';
  identity << write_toml(fields_of(options)) << std::hexfloat;
  for (const BakePlan& plan : plans) {
    identity << plan.origin.x << ' ' << plan.origin.y << ' ' << plan.origin.z << ' ' << plan.voxel_size << ' '
             << plan.resolution.x << ' ' << plan.resolution.y << ' ' << plan.resolution.z << '\n';
  }
  for (const BakeCamera& camera : cameras) identity << camera_json(camera).dump() << '\n';
  return identity.str();
}

/// Photographs as the program sees them, undistorted, made by all threads.
std::vector<WebPhoto> photos_of(std::span<const View> views, int side, int quality) {
  std::vector<WebPhoto> photos(views.size());
  parallel_tasks(views.size(), [&](std::size_t i) {
    photos[i] = make_web_photo(views[i].intrinsics, luminance_plane(views[i].image), side, quality);
  });
  return photos;
}

/// Who coloured a bake.
struct ColorOrigin {
  std::string colorizer, take;
};

BakeOptions volume_options(const Config& config, const BakeFormats& formats) {
  BakeOptions options = config.bake;
  if (formats.web && !formats.vdb && !formats.gltf) {
    options.resolution = std::min(options.resolution, config.web.resolution);
    if (options.grids == "auto") options.grids = "one";  // the bundle would only average finer ones
  }
  return options;
}

void write_volumes(const std::vector<VolumePlanes>& volumes, const BakeOptions& options, const RunContext& context,
                   BakeFolder& bake, Observer& observer) {
  VdbOptions vdb = context.config.vdb;
  vdb.dilation = options.dilation;
  for (const fs::path& file : bake.add_volumes(volumes, "volume", vdb)) observer.wrote("volume", file);
}

void write_web_of(const std::vector<VolumePlanes>& volumes, const std::vector<BakeCamera>& cameras,
                  const RunContext& context, const fs::path& folder, Observer& observer) {
  std::vector<BakedVolume> whole;
  for (const VolumePlanes& volume : volumes)
    whole.push_back(whole_volume(dilated(volume, context.config.bake.dilation)));
  const Config& config = context.config;
  std::vector<WebPhoto> photos;
  if (config.web.photo_side > 0) {
    photos = photos_of(context.capture.views, config.web.photo_side, config.web.photo_quality);
  }
  write_web(merged_volume(std::move(whole)),
            {context.capture.root.filename().string(), cameras, photos, context.command_line, config.vdb.units,
             config.vdb.up_axis},
            web_folder(folder), config.web, observer);
}

void write_mesh(BakedMesh mesh, const ColorOrigin& origin, const BakeFormats& formats, const RunContext& context,
                BakeFolder& bake, Observer& observer) {
  mesh.colorizer = origin.colorizer;
  mesh.take = origin.take;
  const GltfFiles files = bake.add_mesh(mesh, "mesh", {formats.exr, context.config.exr});
  observer.say(fmt::format("mesh: {} faces, {} charts in {} x {} texels", mesh.triangles.size(), mesh.charts,
                           mesh.texture.size, mesh.texture.size));
  observer.wrote("mesh", files.glb);
  observer.wrote("mesh", files.gltf);
}

void add_plates(const Capture& capture, BakeFolder& bake) {
  constexpr int kPlateSide = 4096, kPlateQuality = 92;
  const std::span<const View> views = capture.views;
  const auto at_a_time = std::size_t(thread_count());
  for (std::size_t begin = 0; begin < views.size(); begin += at_a_time) {
    const auto some = views.subspan(begin, std::min(at_a_time, views.size() - begin));
    const std::vector<WebPhoto> photos = photos_of(some, kPlateSide, kPlateQuality);
    for (std::size_t i = 0; i < some.size(); ++i) bake.add_plate(some[i].name, photos[i].jpeg);
  }
}

}  // namespace

BakeFormats parse_bake_formats(const std::string& list) {
  BakeFormats formats;
  std::istringstream words(list);
  for (std::string format; std::getline(words, format, ',');) {
    bool* flag = format == "vdb"    ? &formats.vdb
                 : format == "gltf" ? &formats.gltf
                 : format == "exr"  ? &formats.exr
                 : format == "web"  ? &formats.web
                                    : nullptr;
    if (flag == nullptr) throw UsageError("--format: expected vdb, gltf, exr or web, got '" + format + "'");
    *flag = true;
  }
  if (!formats.vdb && !formats.gltf && !formats.exr && !formats.web) {
    throw UsageError("--format: expected vdb, gltf, exr or web, got none");
  }
  formats.gltf = formats.gltf || formats.exr;
  return formats;
}

fs::path web_folder(const fs::path& bake) {
  return bake / "web";
}

fs::path last_file(const fs::path& folder, const BakeFormats& formats) {
  return formats.vdb || formats.gltf ? folder / "manifest.json" : web_folder(folder) / kWebManifest;
}

void write_web(const BakedVolume& volume, WebScene scene, const fs::path& folder, const WebOptions& options,
               Observer& observer) {
  const BakedVolume small = resample_volume(volume, options.resolution);
  const WebBricks bricks = make_web_bricks(small, options.density);
  const WebEstimate estimate = estimate_web(bricks);
  const auto mib = [](std::size_t bytes) { return double(bytes) / (1 << 20); };
  observer.say(
      fmt::format("web: {} x {} x {} voxels, {} bricks; about {:.1f} MiB to load, {:.0f} MiB of graphics memory",
                  small.resolution.x, small.resolution.y, small.resolution.z, bricks.stored(),
                  mib(estimate.download_bytes), mib(estimate.texture_bytes)));
  const fs::path page = find_page();
  if (page.empty()) {
    observer.say("note: this cnerf was built without the page (CNERF_VIEWER); the bundle holds data only");
  }
  const WebReport report = write_web_bundle(small, bricks, scene, folder, page, options);
  observer.say(fmt::format("web: {:.2f} MiB of volume, {:.2f} MiB of photographs, {:.0f} KiB of page",
                           mib(report.volume_bytes), mib(report.photo_bytes), double(report.page_bytes) / 1024));
  observer.wrote("web bundle", folder);
}

void bake_step(const RunContext& context, const BakeJob& job, const Engines& engines, Observer& observer) {
  const auto& [take, folder, formats] = job;
  const Stopwatch watch;
  const auto scene = load_scene(context.directory, take, engines);
  const Config& config = context.config;
  const std::vector<BakeCamera> cameras = cameras_of(context.capture);
  const BakeOptions options = volume_options(config, formats);
  const ColorOrigin origin{colorizer_name(context.directory, take), take};
  const std::vector<BakePlan> plans = plan_within_budget(*scene, cameras, options);
  const BakeEstimate estimate = estimate_bake(*scene, plans, options);
  const std::size_t held = held_memory_bytes();
  say_estimate(plans, estimate, observer);
  check_memory(estimate, held, options);

  const fs::path unfinished = folder / "unfinished.bake";
  BakeJournal journal(unfinished, bake_identity(context.directory, take, cameras, plans, options));
  if (journal.found() > 0) observer.say("bake: going on where it was stopped");
  BakeFolder bake(folder, cameras, context.command_line, config.vdb.units, config.vdb.up_axis);
  std::vector<BakeLevel> levels = drop_journal_on_bad_input(
      unfinished, [&] { return bake_levels(*scene, plans, options, journal, observer.progress_sink()); });
  if (formats.vdb || formats.web) {
    std::vector<VolumePlanes> volumes = drop_journal_on_bad_input(
        unfinished, [&] { return bake_volumes(*scene, cameras, levels, options, journal, observer.progress_sink()); });
    if (!formats.gltf) levels.clear();  // grids of files need the memory
    // Density that was given back is still the process's, and is what the grids will take.
    if (formats.vdb) check_writing_memory(volumes, formats.gltf ? held_memory_bytes() : held, options);
    for (VolumePlanes& volume : volumes) {
      volume.colorizer = origin.colorizer;
      volume.take = origin.take;
    }
    if (formats.vdb) write_volumes(volumes, options, context, bake, observer);
    if (formats.web) write_web_of(volumes, cameras, context, folder, observer);
  }
  if (formats.gltf) {
    const BakeLevel level = merged_level(std::move(levels), options);  // a surface needs all of it on one lattice
    write_mesh(bake_mesh(*scene, cameras, level, options, config.mesh, observer.progress_sink()), origin, formats,
               context, bake, observer);
  }
  if (formats.vdb || formats.gltf) {
    if (config.vdb.plates) add_plates(context.capture, bake);
    bake.finish();
    observer.wrote("Blender set-up", bake.blender_setup());
  }
  fs::remove(unfinished);
  note_time(context.directory, "bake", watch);
}

}  // namespace cnerf::pipeline
