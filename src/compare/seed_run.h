#pragma once
/// One capture of a comparison with one seed: stage 1, and on top of it a cell per method.

#include <filesystem>
#include <memory>
#include <string>

#include "src/base/observer.h"
#include "src/colorizer/colorizer.h"
#include "src/compare/baselines/style_transfer.h"
#include "src/compare/cell.h"
#include "src/compare/methods.h"
#include "src/compare/subject.h"
#include "src/evaluate/lpips.h"
#include "src/train/luminance/view_cache.h"

namespace cnerf::compare {

/// What to compare.
struct Plan {
  std::vector<ComparedCapture> captures;
  std::filesystem::path report;  ///< folder
  std::vector<const Method*> methods;
  std::vector<int> seeds;
  std::filesystem::path lpips_weights;    ///< empty = LPIPS is not measured
  std::filesystem::path style_reference;  ///< empty = the middle training view, coloured by the colorizer
  TextGuide text;                         ///< of `clip-nerf`; empty = that method fails
  std::string command_line;
  bool only_report = false;  ///< nothing is trained: the report is made of the cells that are there
};

/// What all cells of a comparison share. All is referred to.
struct Bench {
  const Plan& plan;
  const Config& config;
  const Engines& engines;
  const Lpips* lpips;             ///< null = LPIPS is not measured
  const PictureEncoder* encoder;  ///< null = none is installed
  Observer& observer;
};

/// "0003.jpg": a view or a frame of a turntable in a cell's folder.
[[nodiscard]] std::string numbered(std::size_t index);

class SeedRun {
 public:
  /// All is referred to.
  /// @param folder  REPORT/runs/CAPTURE/seed-N
  SeedRun(const Bench& bench, const Subject& subject, int seed, std::filesystem::path folder);

  /// Stage 1, unless it is there with these settings and of these views.
  void train();
  /// A method's colours, after `train`, unless they are there with these settings. A method that fails leaves a cell
  /// that says why.  @throws Interrupted
  void color(const Method& method);
  /// Its cell, after `color`, also in another process; read where it is there.  @throws Interrupted
  [[nodiscard]] Cell judge(const Method& method) const;

 private:
  struct Field;

  template <typename Part>
  void attempt(Cell& cell, const Part& part) const;
  [[nodiscard]] Field field_of(const Method& method) const;
  [[nodiscard]] std::string settings_of(const Method& method) const;
  [[nodiscard]] std::unique_ptr<Colorizer> colorizer_for(const Method& method) const;
  [[nodiscard]] std::unique_ptr<Colorizer> distilled(const Method& method, Colorizer& colorizer);
  void follow_picture_loss(const Method& method, Colorizer& colorizer, Cell& cell) const;
  void train_own_field(const Engines& engines, Cell& cell) const;
  void colorize(const Method& method, Cell& cell);
  void train_colors(const Method& method, const Field& field, Colorizer& colorizer, Cell& cell);
  void evaluate_views(const Method& method, const Scene& scene, Cell& cell) const;
  void evaluate_turntable(const Method& method, const Scene& scene, Cell& cell) const;

  const Bench& bench_;
  const Subject& subject_;
  int seed_;
  std::filesystem::path folder_, stage1_;  // the snapshot
  std::string stage1_settings_;
  std::string files_;  // what the colorizer's and the judges' hold
  ViewCache training_views_;
};

}  // namespace cnerf::compare
