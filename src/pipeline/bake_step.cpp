#include "src/pipeline/bake_step.h"

#include <algorithm>

#include "bake/job/job.h"
#include "src/base/files.h"
#include "src/base/usage.h"
#include "src/cluster/ranks.h"
#include "src/pipeline/version.h"
#include "viewer/server/page_folder.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;
namespace {

constexpr const char* kJournal = "unfinished.bake";

/// Of which field a bake is.
std::string field_identity(const RunDirectory& directory, const std::string& take) {
  std::string identity = "cnerf " + version_text() + "\n" + sha256_of_file(directory.stage1_snapshot()) + "\n";
  if (!take.empty()) identity += sha256_of_file(directory.take_snapshot(take)) + "\n";
  return identity;
}

bake::Options volume_options(const Config& config, const exporting::Formats& formats) {
  bake::Options options = config.bake;
  if (options.max_memory.empty()) options.max_memory = config.max_memory;
  if (formats.web && !formats.has_manifest()) options.resolution = std::min(options.resolution, config.web.resolution);
  return options;
}

}  // namespace

void bake_step(const RunContext& context, const BakeJob& job, const Engines& engines, Observer& observer) {
  const auto& [take, folder, formats] = job;
  const StepLocks locks(context.directory, folder, observer);
  const cluster::RanksWait others_wait(cluster::world(), "bake");
  if (!cluster::world().is_first()) return;
  const Stopwatch watch;
  const auto scene = load_scene(context.directory, take, context.config.finish, engines);
  const Config& config = context.config;
  bake::Job bake{*scene, engines, bake::cameras_of(context.capture), volume_options(config, formats)};
  bake.volumes = formats.volumes();
  if (formats.gltf) bake.mesh = config.mesh;
  bake.journal = folder / kJournal;
  bake.identity = field_identity(context.directory, take);
  const exporting::Label label{{colorizer_name(context.directory, take), take, context.command_line}, config.world};
  exporting::BakeOutput output(folder, formats, {config.vdb, config.web, web::find_page()}, context.capture, label,
                               observer);
  bake::run(bake, output, observer);
  note_time(context.directory, "bake", watch);
}

void end_bake(const RunDirectory& directory, const fs::path& folder, Observer& observer) {
  const StepLocks locks(directory, folder, observer);
  if (cluster::world().is_first()) fs::remove(folder / kJournal);
}

}  // namespace cnerf::pipeline
