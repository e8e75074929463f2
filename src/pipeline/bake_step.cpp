#include "src/pipeline/bake_step.h"

#include <fmt/format.h>

#include <algorithm>

#include "bake/job/job.h"
#include "bake/splat/bake_splats.h"
#include "src/base/files.h"
#include "src/base/usage.h"
#include "src/cluster/ranks.h"
#include "src/pipeline/version.h"
#include "viewer/server/page_folder.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;
namespace {

constexpr const char* kJournal = "unfinished.bake";

/// Of which field a bake is, and what is made of its colours and light.
std::string field_identity(const RunDirectory& directory, const std::string& take, const Finish& finish) {
  std::string identity = "cnerf " + version_text() + "\n" + sha256_of_file(directory.stage1_snapshot()) + "\n";
  if (!take.empty()) identity += sha256_of_file(directory.take_snapshot(take)) + "\n";
  return identity + fmt::format("finish {} {} {}\n", finish.saturation, finish.hue, finish.exposure);
}

bake::Options volume_options(const Config& config, const exporting::Formats& formats) {
  bake::Options options = config.bake;
  if (options.max_memory.empty()) options.max_memory = config.max_memory;
  if (formats.web && !formats.is_for_blender())
    options.resolution = std::min(options.resolution, config.web.resolution);
  return options;
}

/// What the scene shows a camera, with colours of samples as all bakes have them; grey where it is not colorized.
bake::FieldPicture field_picture(const Scene& scene, const Intrinsics& intrinsics, const Affined& world_from_camera) {
  RenderOptions options;
  options.color = false;
  options.baked_color = true;
  options.sky = false;
  RenderedImage image = scene.render(intrinsics, world_from_camera, options);
  if (image.baked_rgb.empty()) {
    for (const float light : image.luminance) image.baked_rgb.insert(image.baked_rgb.end(), 3, light);
  }
  return {std::move(image.baked_rgb), std::move(image.opacity), std::move(image.depth)};
}

bake::SplatCloud make_splats(const Scene& scene, const Capture& capture, const bake::SplatOptions& options,
                             Observer& observer) {
  bake::SplatJob job;
  job.draw = [&](const Intrinsics& intrinsics, const Affined& world_from_camera) {
    return field_picture(scene, intrinsics, world_from_camera);
  };
  job.frame = scene.frame();
  for (const View& view : capture.views) {
    if (!view.held_out) job.cameras.push_back({view.name, view.intrinsics, view.world_from_camera});
  }
  job.options = options;
  return bake::bake_splats(job, observer);
}

/// Of ranks that find voxels for rank 0.
class NoOutput final : public bake::Output {
 public:
  void take_volumes(const std::vector<bake::VolumePlanes>& /*volumes*/) override {}
  void take_mesh(const bake::Mesh& /*mesh*/) override {}
  void finish() override {}
};

}  // namespace

std::vector<fs::path> whole_bakes(const fs::path& folder, const exporting::Formats& formats) {
  std::vector<fs::path> files = {last_file(folder, formats)};
  if (formats.web && !fs::exists(folder / kJournal)) files.push_back(exporting::last_file(folder, {.web = true}));
  return files;
}

void bake_step(const RunContext& context, const BakeJob& job, const Engines& engines, Observer& observer) {
  const auto& [take, folder, formats, loaded] = job;
  const StepLocks locks(context.directory, folder, observer);
  cluster::Ranks& world = cluster::world();
  const cluster::RanksWait others_wait(world, "bake");
  if (formats.has_only_splats() && !world.is_first()) return;
  const Stopwatch watch;
  const StepScene scene(loaded, context.directory, take, context.config.finish, engines);
  const Config& config = context.config;
  bake::Job bake{*scene, engines, bake::cameras_of(context.capture), volume_options(config, formats), world};
  bake.volumes = formats.volumes();
  if (formats.gltf) bake.mesh = config.mesh;
  bake.journal = folder / kJournal;
  bake.identity = field_identity(context.directory, take, config.finish);
  if (!world.is_first()) {
    NoOutput none;
    return bake::run(bake, none, observer);
  }
  const exporting::Label label{{colorizer_name(context.directory, take), take, context.command_line}, config.world};
  exporting::BakeOutput output(folder, formats, {config.vdb, config.web, web::find_page(), scene->sky()},
                               context.capture, label, observer);
  if (formats.splat) {
    output.take_splats([&] { return make_splats(*scene, context.capture, config.splat, observer); });
  }
  if (formats.has_only_splats()) {
    output.finish();
  } else {
    bake::run(bake, output, observer);
  }
  note_time(context.directory, "bake", watch);
}

void end_bake(const RunDirectory& directory, const fs::path& folder, Observer& observer) {
  const StepLocks locks(directory, folder, observer);
  if (cluster::world().is_first()) remove_output(folder / kJournal);
}

}  // namespace cnerf::pipeline
