#pragma once
/// Stage 1: luminance and density from monochrome views (paper, Sec. "Luminance and density representation").

#include <filesystem>
#include <functional>
#include <limits>
#include <vector>

#include "src/base/observer.h"
#include "src/capture/capture.h"
#include "src/cluster/ranks.h"
#include "src/engine/engines.h"
#include "src/train/luminance/luminance_model.h"
#include "src/train/luminance/stage1_options.h"

namespace cnerf {

struct Stage1Report {
  int steps = 0;
  double seconds = 0;  ///< training time only, over all resumed parts
  double trained_samples = 0;
  double train_psnr = 0;  ///< luminance dB over the rays of the last 100 steps since it began or went on
  int sky_views = 0;      ///< training views that show a sky
  double sky_share = 0;   ///< of all their pixels
};

/// Whether a training with these options may go on from `snapshot`, if there is one.
/// @throws SnapshotError  it is of another version, damaged, or of a training with other options.
void check_continues(const std::filesystem::path& snapshot, const Stage1Options& options);
/// Whether `snapshot`, if there is one, was trained on these views: what is held out says nothing otherwise.
/// @throws SnapshotError  it is of another version, damaged, or of a training on other views.
void check_views(const std::filesystem::path& snapshot, const Capture& capture);

/// What stage 1 works on.
struct Stage1Job {
  const Capture& capture;
  const Stage1Options& options;
  std::filesystem::path snapshot;                         ///< that the result goes to
  bool resume = false;                                    ///< go on with the snapshot, if there is one
  std::vector<SparsePoint> points = {};                   ///< in place of the capture's, which has none
  LearnedViews moved = {};                                ///< how the capture's cameras were moved before
  std::function<void(const LuminanceModel&)> watch = {};  ///< sees the model between steps, in no training time
  cluster::Ranks& ranks = cluster::alone();               ///< that share the steps; rank 0 saves
  /// See LuminanceEngine::limit_image_memory.
  std::size_t image_memory = std::numeric_limits<std::size_t>::max();

  [[nodiscard]] bool goes_on() const { return resume && std::filesystem::exists(snapshot); }
  [[nodiscard]] const std::vector<SparsePoint>& known_points() const {
    return points.empty() ? capture.points : points;
  }
};

/// Trains and leaves the result in the job's snapshot. What the observer takes is no training time; previews show
/// held-out views, or some of all. Resuming continues bit for bit on the CPU, whatever the number of threads.
/// Several ranks of a job share its steps: each works on its own pixels of the same random numbers. The result is the
/// same bit by bit for equal numbers of ranks, and within rounding of sums for others.
/// @throws Interrupted    after saving, when the observer of any rank cancelled.
/// @throws SnapshotError  the snapshot is of another version, cut short, or of another configuration.
Stage1Report train_stage1(const Stage1Job& job, const Engines& engines, Observer& observer);

}  // namespace cnerf
