#pragma once
/// Stage 1's result in memory: where the box lies, how to march, and the engine. Both stages and the Scene build on it.

#include <filesystem>
#include <memory>

#include "src/capture/capture.h"
#include "src/engine/engines.h"
#include "src/engine/luminance_engine.h"
#include "src/field/scene_frame.h"
#include "src/train/luminance/free_space.h"
#include "src/train/luminance/seen_scene.h"
#include "src/train/luminance/snapshot.h"
#include "src/train/luminance/stage1_options.h"
#include "src/train/luminance/training_pace.h"

namespace cnerf {

/// What was learned of a training's views.
struct LearnedViews {
  SceneFrame frame;
  std::vector<ViewCorrection> corrections;  ///< of the training views in their order; empty where nothing was learned
  std::vector<LensCorrection> lenses;       ///< as `lenses_of` lists them; likewise

  /// This, and what was learned after it of the views as this left them: in the units of the latter.
  [[nodiscard]] LearnedViews followed_by(const LearnedViews& next) const;
};

/// Which views of a capture are trained on, and how their pixels were read: the same for the same ones.
[[nodiscard]] std::string digest_of_training(const Capture& capture);

/// What a training was of; texts are empty where an earlier version did not say.
struct TrainedOn {
  std::string views;    ///< digest_of_training
  std::string cameras;  ///< Capture::cameras
};

/// @param trained  Capture::cameras of the training
/// @throws SnapshotError  where both are known and differ
void refuse_other_cameras(const std::filesystem::path& snapshot, const std::string& trained, const Capture& capture);

struct LuminanceModel {
  SceneFrame frame;
  Stage1Options options;
  float max_luminance = 1;
  int learned_views = 0;       ///< training views of which something is learned; 0: nothing is
  int learned_lenses = 0;      ///< lenses that are learned
  double seconds = 0;          ///< training time so far
  double trained_samples = 0;  ///< so far
  TrainingPace pace;
  std::string kernels;         ///< that its engine computes with, see kernels_of
  std::string kernels_before;  ///< of the snapshot it was read from; empty where that does not say
  std::unique_ptr<LuminanceEngine> engine;
  LearnedViews moved;  ///< how cameras were moved before the training, which learns from there; empty: not at all
  TrainedOn trained_on;
  DirectionMap sky;  ///< linear Y beyond the box, at the median view's exposure; none where no view sees one

  /// A fresh model for a capture. The first form knows of free space what the capture's own points say.
  static LuminanceModel create(const Capture& capture, const Stage1Options& options, const Engines& engines);
  /// @param points  that the box is placed by
  static LuminanceModel create(const Capture& capture, const Stage1Options& options, const Engines& engines,
                               const FreeSpace& free_space, const std::vector<SparsePoint>& points);
  /// @throws MissingInputError, SnapshotError
  static LuminanceModel load(const std::filesystem::path& snapshot, const Engines& engines);
  /// Only what it was trained with.  @throws MissingInputError, SnapshotError
  static Stage1Options options_in(const std::filesystem::path& snapshot);
  /// Only where its box lies.  @throws MissingInputError, SnapshotError
  static SceneFrame frame_in(const std::filesystem::path& snapshot);
  /// Only what it was trained on.  @throws MissingInputError, SnapshotError
  static TrainedOn trained_on_in(const std::filesystem::path& snapshot);
  /// Only what was learned of its views, before it and by it.  @throws MissingInputError, SnapshotError
  static LearnedViews learned_views_in(const std::filesystem::path& snapshot);
  void save(const std::filesystem::path& snapshot) const;

  /// How to march; `steps_per_box` = 0 as in training.
  [[nodiscard]] MarchSettings march(int steps_per_box = 0) const {
    return march_settings(frame.cascades, steps_per_box > 0 ? steps_per_box : options.steps_per_box,
                          options.cone_angle);
  }
  [[nodiscard]] DirectionView sky_light() const { return sky.exists() ? sky.plane(0) : DirectionView(); }
  /// As training marched.
  [[nodiscard]] SeenScene seen() const { return {*engine, march(), sky_light()}; }
};

/// SceneFrame in snapshot headers.
[[nodiscard]] nlohmann::json frame_to_json(const SceneFrame& frame);
[[nodiscard]] SceneFrame frame_from_json(const nlohmann::json& json);

}  // namespace cnerf
