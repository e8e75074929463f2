#pragma once
/// Session: what all phases of one stage 2 share: the views, the model that grows, its clock, and who watches.

#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "src/base/usage.h"
#include "src/train/chroma/color_model.h"
#include "src/train/chroma/stage2.h"
#include "src/train/luminance/luminance_model.h"

namespace cnerf {

class Session {
 public:
  /// Refers to both.
  Session(const Stage2Job& job, Observer& observer);

  /// A fresh model, or the take's where the job goes on with one.
  /// @throws SnapshotError  the take was made otherwise.
  void start_or_resume(const Engines& engines, PixelColors pixel_colors);
  /// Traces what the views see, unless the job brings it.
  void cache_views(const Engines& engines);

  /// The capture's, and the job's viewpoints; other viewpoints of a cache that the job brings are none of its business,
  /// and may come to it meanwhile.
  [[nodiscard]] std::span<const CachedView> views() const { return views_; }
  [[nodiscard]] std::span<const std::string> names() const { return names_; }
  [[nodiscard]] cluster::Ranks& ranks() const { return job_.ranks; }
  [[nodiscard]] std::filesystem::path folder() const { return job_.take.parent_path(); }

  using Figures = std::vector<std::pair<std::string, double>>;
  /// Tells the observer, and saves and stops when it cancelled. Without a model there is nothing to save.  @throws
  /// Interrupted.
  void report(const std::string& task, double fraction, Figures figures = {});
  /// The same with the figures of a step. All ranks stop where one cancelled.
  void after_step(const std::string& task, const std::string& loss_name, long done, int all);
  /// On rank 0; the others wait.
  void save();

  const Stage2Options& options;
  Colorizer& colorizer;
  ColorModel model;
  double loss = 0;  ///< of the last step

 private:
  void begin_model(const Engines& engines, PixelColors pixel_colors);
  void tell(const std::string& task, double fraction, Figures figures);
  void cache_previews(const LuminanceModel& luminance);
  [[nodiscard]] PreviewPicture preview(std::size_t index) const;

  const Stage2Job& job_;
  Observer& observer_;
  ViewCache own_cache_;
  ViewCache& cache_;
  std::span<const CachedView> views_;
  std::span<const std::string> names_;
  std::vector<std::pair<std::string, CachedView>> previews_;  // of held-out views, small
  TrainingClock clock_;
  double seconds_before_ = 0;
};

}  // namespace cnerf
