#include "bake/job/job.h"

#include <fmt/format.h>

#include <optional>
#include <sstream>
#include <utility>

#include "bake/density/nested.h"
#include "bake/job/estimate.h"
#include "bake/mesh/bake_mesh.h"
#include "bake/visibility/view_selection.h"
#include "bake/volume/bake_volumes.h"
#include "bake/volume/dilate.h"
#include "src/base/byte_count.h"
#include "src/base/error.h"
#include "src/base/usage.h"

namespace cnerf::bake {
namespace {

void say_estimate(const std::vector<Plan>& plans, const Estimate& estimate, Observer& observer) {
  for (const Plan& plan : plans) {
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

/// Visitor of options: "name value" per line.
struct OptionText {
  std::ostream& out;
  template <typename Value, typename... Description>
  void operator()(const char* name, const Value& value, const Description&...) {
    out << name << ' ' << value << '\n';
  }
};

/// All that a bake's voxels depend on: what differs in any of it does not continue another.
std::string identity_of(const Job& job, const std::vector<Plan>& plans) {
  Options options = job.options;
  options.max_memory.clear();  // a bake may go on with more of it
  std::ostringstream identity;
  identity << job.identity << '\n' << std::hexfloat;
  options.visit(OptionText{identity});
  for (const Plan& plan : plans) {
    identity << plan.origin.x << ' ' << plan.origin.y << ' ' << plan.origin.z << ' ' << plan.voxel_size << ' '
             << plan.resolution.x << ' ' << plan.resolution.y << ' ' << plan.resolution.z << '\n';
  }
  for (const Camera& camera : job.cameras) {
    const Intrinsics& lens = camera.intrinsics;
    identity << camera.name << ' ' << int(lens.model) << ' ' << lens.width << ' ' << lens.height << ' ' << lens.fx
             << ' ' << lens.fy << ' ' << lens.cx << ' ' << lens.cy;
    for (const double coefficient : lens.distortion) identity << ' ' << coefficient;
    const auto& [linear, centre] = camera.world_from_camera;
    for (const Vec3d& row : linear.rows) identity << ' ' << row.x << ' ' << row.y << ' ' << row.z;
    identity << ' ' << centre.x << ' ' << centre.y << ' ' << centre.z << '\n';
  }
  return identity.str();
}

/// What `make` makes. Where the input is at fault the journal goes: the same parts would fail again.
template <typename Make>
auto drop_on_bad_input(const std::filesystem::path& journal, const Make& make) {
  try {
    return make();
  } catch (const InputError&) {
    std::filesystem::remove(journal);
    throw;
  }
}

std::vector<VolumePlanes> make_volumes(const Job& job, const std::vector<Level>& levels, Journal& journal,
                                       Observer& observer) {
  const auto views = select_views(job.cameras, density_levels(levels), job.options, job.engines, observer);
  return bake_volumes(job.field, *views, levels, job.options, journal, observer.progress_sink());
}

/// What is made of the field, all of which is in the journal afterwards.
struct Passes {
  std::vector<Level> levels;
  std::vector<VolumePlanes> volumes;
};

Passes make_passes(const Job& job, const std::vector<Plan>& plans, Journal& journal, Observer& observer) {
  Passes passes{bake_levels(job.field, plans, job.options, journal, observer.progress_sink()), {}};
  if (job.volumes != VolumeUse::kNone) passes.volumes = make_volumes(job, passes.levels, journal, observer);
  return passes;
}

/// A journal that this bake cannot have written is not believed: all is made anew.
Passes go_on(const Job& job, const std::vector<Plan>& plans, Journal& journal, Observer& observer) {
  if (!journal.has_found_any()) return make_passes(job, plans, journal, observer);
  observer.say("bake: going on where it was stopped");
  try {
    return make_passes(job, plans, journal, observer);
  } catch (const JournalError& error) {
    observer.say(std::string("bake: ") + error.what() + "; starting anew");
    journal.restart();
    return make_passes(job, plans, journal, observer);
  }
}

/// Of a mesh, which is there while grids are written.
std::size_t memory_of_textures(const Job& job) {
  constexpr std::size_t kBytesPerTexel = 25;
  return job.mesh ? kBytesPerTexel * std::size_t(job.mesh->texture_size) * std::size_t(job.mesh->texture_size) : 0;
}

/// Nothing where none is wanted. The levels' memory goes: grids of files need it.
std::optional<Mesh> make_mesh(const Job& job, std::vector<Level> levels, Observer& observer) {
  if (!job.mesh) return std::nullopt;
  const Level level = merged_level(std::move(levels), job.options);  // a surface needs all of it on one lattice
  return bake_mesh(job.field, job.cameras, level, job.options, *job.mesh, observer.progress_sink());
}

}  // namespace

void run(const Job& job, Output& output, Observer& observer) {
  const Options& options = job.options;
  const std::vector<Plan> plans = plan_within_budget(job.field, job.cameras, options);
  const Estimate estimate = estimate_bake(job.field, plans, options);
  const std::size_t held = held_memory_bytes();
  say_estimate(plans, estimate, observer);
  check_memory(estimate, held, options);

  Journal journal = job.ranks.is_first() ? Journal(job.journal, identity_of(job, plans)) : Journal();
  journal.share_with(job.ranks);
  auto [levels, volumes] = drop_on_bad_input(job.journal, [&] { return go_on(job, plans, journal, observer); });
  if (!job.ranks.is_first()) return;
  // Density that was given back is still the process's, and is what the grids will take.
  if (job.volumes == VolumeUse::kGrids) check_writing_memory(volumes, held + memory_of_textures(job), options);
  std::optional<Mesh> mesh = make_mesh(job, std::move(levels), observer);  // may be refused: before any output
  if (job.volumes != VolumeUse::kNone) {
    for (VolumePlanes& volume : volumes) volume = dilated(volume, options.dilation);
    output.take_volumes(volumes);
  }
  if (mesh) output.take_mesh(*mesh);
  mesh.reset();
  output.finish();
  std::filesystem::remove(job.journal);
}

}  // namespace cnerf::bake
