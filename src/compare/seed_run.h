#pragma once
/// One capture of a comparison with one seed: stage 1, and on top of it a cell per method.

#include <filesystem>
#include <memory>
#include <string>

#include "src/base/observer.h"
#include "src/colorizer/colorizer.h"
#include "src/compare/baselines/simulated.h"
#include "src/compare/baselines/style_transfer.h"
#include "src/compare/cell.h"
#include "src/compare/methods.h"
#include "src/compare/options.h"
#include "src/compare/remembered_rays.h"
#include "src/compare/subject.h"
#include "src/evaluate/lpips.h"
#include "src/train/luminance/view_cache.h"

namespace cnerf::compare {

/// What all cells of a comparison share. All is referred to.
struct Bench {
  const CompareConfig& config;
  const Engines& engines;
  const Lpips* lpips;                   ///< null = LPIPS is not measured
  std::filesystem::path lpips_weights;  ///< of `lpips`
  Observer& observer;
};

/// Whether a colorizer's spec names the one that errs on purpose.
[[nodiscard]] bool is_simulated(const std::string& spec);
/// Its options.  @throws UsageError
[[nodiscard]] SimulationOptions simulation_of(const std::string& spec);

/// "0003.jpg": a view or a frame of a turntable in a cell's folder.
[[nodiscard]] std::string numbered(std::size_t index);

class SeedRun {
 public:
  /// All is referred to.
  /// @param folder  REPORT/runs/CAPTURE/seed-N
  SeedRun(const Bench& bench, const Subject& subject, int seed, std::filesystem::path folder);

  /// Stage 1, unless it is there with these settings.
  void train();
  /// A method's cell, after `train`; read where it is there with these settings and did not fail. A method that fails
  /// leaves one that says why.  @throws Interrupted
  [[nodiscard]] Cell make(const Method& method);

 private:
  struct Field;

  [[nodiscard]] Field field_of(const Method& method) const;
  [[nodiscard]] std::string settings_of(const Method& method) const;
  [[nodiscard]] std::unique_ptr<Colorizer> colorizer_for(const Method& method) const;
  [[nodiscard]] StyleReport transfer(const Stage2Options& options, Colorizer& colorizer,
                                     const std::filesystem::path& take) const;
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
  ViewCache training_views_;
  RememberingEngines rendering_;
};

}  // namespace cnerf::compare
