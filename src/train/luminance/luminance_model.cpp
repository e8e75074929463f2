#include "src/train/luminance/luminance_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <span>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/json_record.h"
#include "src/engine/stage1_schedule.h"
#include "src/train/luminance/exclusion.h"
#include "src/train/luminance/options_json.h"
#include "src/train/luminance/placement.h"
#include "src/train/luminance/stored_grid.h"

namespace cnerf {
namespace {

constexpr const char* kKind = "stage1";

/// @throws UsageError  a ray could have more samples than engines look at: what is far away would be lost unnoticed
void check_samples_of_rays(const SceneFrame& frame, const Stage1Options& options) {
  const MarchSettings march = march_settings(frame.cascades, options.steps_per_box, options.cone_angle);
  const int most = MarchLattice(march, 0, 0).index_at(std::sqrt(3.0f));
  if (most <= kMostSamplesOfRay) return;
  throw UsageError(fmt::format("stage1.steps_per_box: expected at most {} samples along a ray, got {}, which make {}{}",
                               kMostSamplesOfRay, options.steps_per_box, most,
                               frame.cascades > 1 ? "; a greater stage1.cone_angle makes fewer" : ""));
}

std::unique_ptr<LuminanceEngine> make_engine(const LuminanceModel& model, const Engines& engines) {
  const SceneFrame& frame = model.frame;
  const Stage1Options& options = model.options;
  LuminanceEngineOptions engine;
  engine.grid = options.grid;
  engine.occupancy = options.occupancy;
  engine.cascades = frame.cascades;
  engine.march = march_settings(frame.cascades, options.steps_per_box, options.cone_angle);
  engine.samples_per_step = options.samples_per_step;
  engine.distortion_weight = float(options.distortion_weight);
  engine.depth.weight = float(options.depth_weight);
  engine.max_luminance = model.max_luminance;
  if (model.learned_views > 0) {
    engine.learning = {model.learned_views, model.learned_lenses, options.exposures, options.poses};
  }
  engine.seed = std::uint64_t(options.seed);
  return engines.make_luminance(engine);
}

/// White of integer images. Floating point ones may be brighter, and what was taken darker than the others.
float brightest(const Capture& capture) {
  float brightest = 1.0f;
  for (const View& view : capture.views) {
    const MonoImage& image = view.image;
    const bool is_as_stored = image.exposure == 1 && image.haze == 0;
    if (view.held_out || (is_as_stored && image.depth != PixelDepth::kF32)) continue;
    for (std::size_t p = 0; p < image.pixel_count(); ++p) {
      if (image.valid(p)) brightest = std::max(brightest, image.luminance(p));
    }
  }
  return brightest;
}

/// What shapes the occupancy grid, which is part of a snapshot but no option of a user's.
nlohmann::json occupancy_to_json(const OccupancyOptions& options) {
  return {
      {"resolution", options.resolution}, {"decay", options.decay}, {"optical_thickness", options.optical_thickness}};
}

/// Earlier versions kept it among the options.
OccupancyOptions occupancy_of(const nlohmann::json& header) {
  const nlohmann::json& json =
      header.contains("occupancy") ? header.at("occupancy") : header.at("options").at("occupancy");
  OccupancyOptions options;
  read_exactly(json.at("decay"), options.decay);
  read_exactly(json.at("optical_thickness"), options.optical_thickness);
  read_exactly(json.at("resolution"), options.resolution);
  return options;
}

Stage1Options stored_options(const Snapshot& snapshot) {
  return from_header(snapshot, [](const nlohmann::json& header) {
    auto options = options_from_json<Stage1Options>(header.at("options"));
    options.occupancy = occupancy_of(header);
    return options;
  });
}

SceneFrame stored_frame(const Snapshot& snapshot) {
  return from_header(snapshot, [](const nlohmann::json& header) { return frame_from_json(header.at("frame")); });
}

/// How many views or lenses a training learned of; earlier versions learned nothing of them.
int learned_count(const Snapshot& snapshot, const char* field) {
  return snapshot.header().contains(field) ? header_field<int>(snapshot, field) : 0;
}

/// Earlier versions did not say all that there is to say.
std::string stored_text(const Snapshot& snapshot, const char* field) {
  return snapshot.header().contains(field) ? header_field<std::string>(snapshot, field) : "";
}

TrainedOn stored_training(const Snapshot& snapshot) {
  return {stored_text(snapshot, "trained_on"), stored_text(snapshot, "cameras")};
}

/// A piece of so many structs of floats; nothing is looked for where there are to be none.
template <typename Numbers>
std::vector<Numbers> stored_piece(const Snapshot& snapshot, const char* name, int count) {
  if (count == 0) return {};
  const std::span<const std::byte> stored = snapshot.piece(name);
  std::vector<Numbers> values(stored.size() / sizeof(Numbers));
  const StatePiece piece = state_piece(name, values);
  std::ranges::copy(stored.first(piece.bytes.size()), piece.bytes.begin());
  if (std::ptrdiff_t(values.size()) != count || !piece.is_finite()) {
    throw SnapshotError(snapshot.file().string() + ": piece '" + name + "' is damaged");
  }
  return values;
}

constexpr const char *kMovedViews = "moved.views", *kMovedLenses = "moved.lenses";

/// Earlier versions moved none. Its unit is the world's.
LearnedViews stored_moves(const Snapshot& snapshot) {
  return {{{}, 1, 1},
          stored_piece<ViewCorrection>(snapshot, kMovedViews, learned_count(snapshot, "moved_views")),
          stored_piece<LensCorrection>(snapshot, kMovedLenses, learned_count(snapshot, "moved_lenses"))};
}

void add_moves(LearnedViews& moved, std::vector<StatePiece>& pieces) {
  if (!moved.corrections.empty()) pieces.push_back(state_piece(kMovedViews, moved.corrections));
  if (!moved.lenses.empty()) pieces.push_back(state_piece(kMovedLenses, moved.lenses));
}

constexpr const char* kSky = "sky";
constexpr int kWidestSky = 4096;

DirectionMap stored_sky(const Snapshot& snapshot) {
  const int width = learned_count(snapshot, "sky_width");
  if (width == 0) return {};
  if (width < 0 || width > kWidestSky || width % 2 != 0) {
    throw SnapshotError(snapshot.file().string() + ": header: sky_width: expected an even number up to 4096");
  }
  return {width, width / 2, {stored_piece<float>(snapshot, kSky, width * (width / 2))}};
}

/// Earlier versions kept none.
TrainingPace stored_pace(const Snapshot& snapshot, const Stage1Options& options) {
  PaceState state;
  if (snapshot.header().contains("pace")) {
    const nlohmann::ordered_json json = snapshot.header().at("pace");
    state = record_of<PaceState, SnapshotError>(json, snapshot.file().string() + ": header: pace");
    if (state.falls_from < 0 || state.falls_from > options.steps) {
      throw SnapshotError(snapshot.file().string() + ": header: pace.falls_from: expected one of the steps");
    }
  }
  return {options.steps, options.least_gain, std::move(state)};
}

/// Of how far a training came, where the engine counts it so.
void check_counters(const Snapshot& snapshot, std::span<const StatePiece> pieces, const Stage1Options& options) {
  const auto found = std::ranges::find(pieces, "counters", &StatePiece::name);
  if (found == pieces.end()) return;
  std::array<std::int64_t, 2> counters{};  // steps done, rays of the next one
  if (found->bytes.size() == sizeof counters) std::memcpy(counters.data(), found->bytes.data(), sizeof counters);
  const auto [steps, rays] = counters;
  if (steps >= 0 && steps <= options.steps && rays >= kFewestRays && rays <= kMostRays) return;
  throw SnapshotError(snapshot.file().string() +
                      fmt::format(": piece 'counters': expected at most {} steps and {} to {} rays, got {} and {}",
                                  options.steps, kFewestRays, kMostRays, steps, rays));
}

/// Of what decides how much memory an engine takes, and of what it divides by.
void check_stored(const Snapshot& snapshot, const LuminanceModel& model) {
  constexpr int kMostCascades = 8, kBlock = 16, kMostResolution = 1 << 10, kMostSamples = 1 << 24, kMostSteps = 1 << 16;
  const auto require = [&](bool holds, const char* what) {
    if (!holds) throw SnapshotError(snapshot.file().string() + ": header: " + what);
  };
  const SceneFrame& frame = model.frame;
  const Vec3d& centre = frame.world_centre;
  require(std::isfinite(centre.x) && std::isfinite(centre.y) && std::isfinite(centre.z) && frame.unit_per_world > 0 &&
              std::isfinite(frame.unit_per_world),
          "frame: expected finite numbers and a positive scale");
  require(frame.cascades >= 1 && frame.cascades <= kMostCascades, "frame.cascades: expected 1 to 8");
  require(model.max_luminance > 0 && std::isfinite(model.max_luminance), "max_luminance: expected a positive number");
  require(model.learned_views >= 0 && std::size_t(model.learned_views) <= snapshot.bytes() / sizeof(ViewMoments),
          "learned_views: expected as many as the file can hold");
  require(model.learned_lenses >= 0 && model.learned_lenses <= model.learned_views,
          "learned_lenses: expected at most one per view");
  const Stage1Options& options = model.options;
  require(options.samples_per_step >= 1 && options.samples_per_step <= kMostSamples,
          "options.samples_per_step: expected 1 to 2^24");
  require(options.steps_per_box >= 1 && options.steps_per_box <= kMostSteps,
          "options.steps_per_box: expected 1 to 2^16");
  require(options.cone_angle > 0 && options.cone_angle <= 1, "options.cone_angle: expected a number of 0 to 1");
  check_stored_grid(snapshot, options.grid);
  const int side = options.occupancy.resolution;
  require(side >= kBlock && side <= kMostResolution && side % kBlock == 0,
          "occupancy.resolution: expected a multiple of 16 up to 1024");
  const double cells = double(frame.cascades) * side * side * side;
  require(cells * sizeof(float) <= double(snapshot.bytes()), "occupancy.resolution: the file is too small for it");
}

}  // namespace

std::string digest_of_training(const Capture& capture) {
  std::string views;
  for (const View& view : capture.views) {
    if (view.held_out) continue;
    const MonoImage& image = view.image;
    views +=
        fmt::format("{} {} {} {} {}\n", view.name, image.width, image.height, int(image.depth), int(image.transfer));
  }
  return sha256(std::as_bytes(std::span(views)));
}

void refuse_other_cameras(const std::filesystem::path& snapshot, const std::string& trained, const Capture& capture) {
  if (trained.empty() || capture.cameras.empty() || trained == capture.cameras) return;
  throw SnapshotError(snapshot.string() +
                      ": was trained with other cameras; poses and lenses of the capture, and capture.holdout, have to "
                      "be as they were, or train again");
}

nlohmann::json frame_to_json(const SceneFrame& frame) {
  return {{"world_centre", {frame.world_centre.x, frame.world_centre.y, frame.world_centre.z}},
          {"unit_per_world", frame.unit_per_world},
          {"cascades", frame.cascades}};
}

SceneFrame frame_from_json(const nlohmann::json& json) {
  const auto& centre = json.at("world_centre");
  SceneFrame frame{{centre.at(0).get<double>(), centre.at(1).get<double>(), centre.at(2).get<double>()},
                   json.at("unit_per_world").get<double>(),
                   0};
  read_exactly(json.at("cascades"), frame.cascades);
  return frame;
}

LearnedViews LearnedViews::followed_by(const LearnedViews& next) const {
  LearnedViews both = next;
  const double to_next = next.frame.unit_per_world / frame.unit_per_world;
  for (std::size_t v = 0; v < both.corrections.size(); ++v) {
    ViewCorrection& of_both = both.corrections[v];
    of_both.log_gain += corrections[v].log_gain;
    of_both.shift += (to_next * corrections[v].shift.cast<double>()).cast<float>();
    Vec3d axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (Vec3d& axis : axes) {
      axis = turned(of_both.turn.cast<double>(), turned(corrections[v].turn.cast<double>(), axis));
    }
    of_both.turn = rotation_vector(Mat3d::from_columns(axes[0], axes[1], axes[2])).cast<float>();
  }
  for (std::size_t l = 0; l < lenses.size(); ++l) both.lenses[l] = lenses[l].followed_by(both.lenses[l]);
  return both;
}

LuminanceModel LuminanceModel::create(const Capture& capture, const Stage1Options& options, const Engines& engines) {
  const std::vector<SparsePoint> unknown;
  const FreeSpace free_space(capture.views, options.free_space ? capture.points : unknown);
  return create(capture, options, engines, free_space, capture.points);
}

LuminanceModel LuminanceModel::create(const Capture& capture, const Stage1Options& options, const Engines& engines,
                                      const FreeSpace& free_space, const std::vector<SparsePoint>& points) {
  LuminanceModel model;
  model.frame = place_scene(capture, options.placement, points);
  check_samples_of_rays(model.frame, options);
  model.trained_on = {digest_of_training(capture), capture.cameras};
  model.options = options;
  model.max_luminance = brightest(capture);
  if (options.lenses) model.learned_lenses = int(lenses_of(capture).size());
  if (options.exposures || options.poses || options.lenses) {
    model.learned_views = int(std::ranges::count_if(capture.views, [](const View& view) { return !view.held_out; }));
  }
  model.pace = TrainingPace(options.steps, options.least_gain);
  model.kernels = kernels_of(engines);
  model.engine = make_engine(model, engines);
  exclude_empty(capture, model.frame, free_space, *model.engine);
  return model;
}

Stage1Options LuminanceModel::options_in(const std::filesystem::path& file) {
  return stored_options(Snapshot(file, kKind));
}

SceneFrame LuminanceModel::frame_in(const std::filesystem::path& file) {
  return stored_frame(Snapshot(file, kKind));
}

TrainedOn LuminanceModel::trained_on_in(const std::filesystem::path& file) {
  return stored_training(Snapshot(file, kKind));
}

LearnedViews LuminanceModel::learned_views_in(const std::filesystem::path& file) {
  const Snapshot snapshot(file, kKind);
  LearnedViews learned;
  learned.frame = stored_frame(snapshot);
  learned.corrections = stored_piece<ViewCorrection>(snapshot, "views", learned_count(snapshot, "learned_views"));
  learned.lenses = stored_piece<LensCorrection>(snapshot, "lenses", learned_count(snapshot, "learned_lenses"));
  if (!(learned.frame.unit_per_world > 0)) {
    throw SnapshotError(file.string() + ": header: frame: expected a positive scale");
  }
  const LearnedViews moved = stored_moves(snapshot);
  if (moved.corrections.empty()) return learned;
  if (moved.corrections.size() != learned.corrections.size() ||
      (!moved.lenses.empty() && moved.lenses.size() != learned.lenses.size())) {
    throw SnapshotError(file.string() + ": header: moved_views, moved_lenses: expected as many as were learned of");
  }
  return moved.followed_by(learned);
}

LuminanceModel LuminanceModel::load(const std::filesystem::path& file, const Engines& engines) {
  const Snapshot snapshot(file, kKind);
  LuminanceModel model;
  model.frame = stored_frame(snapshot);
  model.options = stored_options(snapshot);
  model.kernels_before = stored_text(snapshot, "kernels");
  model.trained_on = stored_training(snapshot);
  model.max_luminance = header_field<float>(snapshot, "max_luminance");
  model.seconds = load_times(file)["seconds"];
  model.trained_samples = header_field<double>(snapshot, "trained_samples");
  model.pace = stored_pace(snapshot, model.options);
  model.learned_views = learned_count(snapshot, "learned_views");
  model.learned_lenses = learned_count(snapshot, "learned_lenses");
  check_stored(snapshot, model);
  model.kernels = kernels_of(engines);
  model.engine = make_engine(model, engines);
  model.moved = stored_moves(snapshot);
  model.sky = stored_sky(snapshot);
  std::vector<StatePiece> pieces = model.engine->state();
  if (model.sky.exists()) pieces.push_back(state_piece(kSky, model.sky.planes.front()));
  add_moves(model.moved, pieces);
  snapshot.restore(pieces);
  check_counters(snapshot, pieces, model.options);
  model.engine->state_loaded();
  return model;
}

void LuminanceModel::save(const std::filesystem::path& file) const {
  std::vector<StatePiece> pieces = engine->state();
  std::vector<float> light;
  if (sky.exists()) light = sky.planes.front();
  if (sky.exists()) pieces.push_back(state_piece(kSky, light));
  LearnedViews moves = moved;
  add_moves(moves, pieces);
  save_snapshot(file, kKind,
                {{"frame", frame_to_json(frame)},
                 {"options", options_to_json(options)},
                 {"occupancy", occupancy_to_json(options.occupancy)},
                 {"kernels", kernels},
                 {"trained_on", trained_on.views},
                 {"cameras", trained_on.cameras},
                 {"max_luminance", max_luminance},
                 {"learned_views", learned_views},
                 {"learned_lenses", learned_lenses},
                 {"moved_views", moved.corrections.size()},
                 {"moved_lenses", moved.lenses.size()},
                 {"trained_samples", trained_samples},
                 {"pace", json_of(pace.state())},
                 {"sky_width", sky.width},
                 {"step", engine->step_count()}},
                pieces);
  save_times(file, {{"seconds", seconds}});
}

}  // namespace cnerf
