#include "src/train/luminance_model.h"

#include <algorithm>

#include "src/train/options_json.h"

namespace cnerf {
namespace {

constexpr const char* kKind = "stage1";

std::unique_ptr<LuminanceEngine> make_engine(const SceneFrame& frame, const Stage1Options& options, float max_luminance,
                                             const Engines& engines) {
  LuminanceEngineOptions engine;
  engine.grid = options.grid;
  engine.occupancy = options.occupancy;
  engine.cascades = frame.cascades;
  engine.march = march_settings(frame.cascades, options.steps_per_box, options.cone_angle);
  engine.samples_per_step = options.samples_per_step;
  engine.patch_size = options.sampling == "patches" ? options.patch_size : 0;
  engine.distortion_weight = float(options.distortion_weight);
  engine.max_luminance = max_luminance;
  engine.seed = std::uint64_t(options.seed);
  return engines.make_luminance(engine);
}

/// White of integer images; floating point ones may be brighter.
float brightest(const Capture& capture) {
  float brightest = 1.0f;
  for (const View& view : capture.views) {
    if (view.held_out || view.image.depth != PixelDepth::kF32) continue;
    for (const float value : view.image.f32) brightest = std::max(brightest, value);
  }
  return brightest;
}

/// So many views have to agree on what is in front of what they look at.
constexpr std::ptrdiff_t kAgreeingViews = 3;

/// Leaves out space about which the training views say nothing, so that no fog is learnt and baked there: what none of
/// them sees, what is nearer than the capture's near bound, and what only one or two of them see in front of the point
/// they look at. There each view could hold a picture of its own, just before its lens, and geometry would never form.
/// Behind that point a single view counts: that is where backgrounds are.
void exclude_unseen(const Capture& capture, LuminanceModel& model) {
  struct Eye {
    Affined camera_from_unit;
    const Intrinsics* lens;
    double focus;  ///< distance of what the views look at
  };
  const double world_per_unit = 1.0 / model.frame.unit_per_world;
  const Vec3d focus = arrangement_of(capture).meeting_point;
  std::vector<Eye> eyes;
  for (const View& view : capture.views) {
    if (view.held_out) continue;
    const Affined world_from_unit = {Mat3d::identity() * world_per_unit, model.frame.world_from_unit({0, 0, 0})};
    eyes.push_back({view.world_from_camera.inverse() * world_from_unit, &view.intrinsics,
                    length(view.world_from_camera.translation - focus)});
  }
  const auto agreeing = std::min(kAgreeingViews, std::ptrdiff_t(eyes.size()) / 4);
  const double near = capture.depth_range ? 0.9 * capture.depth_range->near : 0.0;
  model.engine->exclude([&](Vec3f centre, float radius) {
    const double reach = double(radius) * world_per_unit;
    std::ptrdiff_t in_front = 0;
    for (const Eye& eye : eyes) {
      const Vec3d point = eye.camera_from_unit.point(centre.cast<double>());
      if (point.z + reach < near) continue;
      if (length(point) >= 2 * reach) {
        const auto pixel = project(*eye.lens, point);
        if (!pixel) continue;
        const double margin = 1.2 * reach / point.z * eye.lens->fx;
        if (pixel->x < -margin || pixel->y < -margin || pixel->x > eye.lens->width + margin ||
            pixel->y > eye.lens->height + margin) {
          continue;
        }
      }
      if (length(point) + reach > eye.focus || ++in_front >= agreeing) return true;
    }
    return false;
  });
}

}  // namespace

nlohmann::json frame_to_json(const SceneFrame& frame) {
  return {{"world_centre", {frame.world_centre.x, frame.world_centre.y, frame.world_centre.z}},
          {"unit_per_world", frame.unit_per_world},
          {"cascades", frame.cascades}};
}

SceneFrame frame_from_json(const nlohmann::json& json) {
  const auto& centre = json.at("world_centre");
  return {{centre.at(0).get<double>(), centre.at(1).get<double>(), centre.at(2).get<double>()},
          json.at("unit_per_world").get<double>(),
          json.at("cascades").get<int>()};
}

LuminanceModel LuminanceModel::create(const Capture& capture, const Stage1Options& options, const Engines& engines) {
  LuminanceModel model;
  model.frame = place_scene(capture, options.placement);
  model.options = options;
  model.max_luminance = brightest(capture);
  model.engine = make_engine(model.frame, options, model.max_luminance, engines);
  exclude_unseen(capture, model);
  return model;
}

Stage1Options LuminanceModel::options_in(const std::filesystem::path& file) {
  const Snapshot snapshot(file, kKind);
  try {
    return options_from_json<Stage1Options>(snapshot.header().at("options"));
  } catch (const nlohmann::json::exception& problem) {
    throw SnapshotError(file.string() + ": header: " + problem.what());
  }
}

LuminanceModel LuminanceModel::load(const std::filesystem::path& file, const Engines& engines) {
  const Snapshot snapshot(file, kKind);
  LuminanceModel model;
  try {
    model.frame = frame_from_json(snapshot.header().at("frame"));
    model.options = options_from_json<Stage1Options>(snapshot.header().at("options"));
  } catch (const nlohmann::json::exception& problem) {
    throw SnapshotError(file.string() + ": header: " + problem.what());
  }
  model.max_luminance = header_field<float>(snapshot, "max_luminance");
  model.seconds = load_times(file)["seconds"];
  model.trained_samples = header_field<double>(snapshot, "trained_samples");
  model.engine = make_engine(model.frame, model.options, model.max_luminance, engines);
  snapshot.restore(model.engine->state());
  model.engine->state_loaded();
  return model;
}

void LuminanceModel::save(const std::filesystem::path& file) const {
  save_snapshot(file, kKind,
                {{"frame", frame_to_json(frame)},
                 {"options", options_to_json(options)},
                 {"max_luminance", max_luminance},
                 {"trained_samples", trained_samples},
                 {"step", engine->step_count()}},
                engine->state());
  save_times(file, {{"seconds", seconds}});
}

}  // namespace cnerf
