#pragma once
/// Stage 2 as a step of a run.

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "src/colorizer/colorizer.h"
#include "src/engine/engines.h"
#include "src/picture/contact_sheet.h"
#include "src/pipeline/run_context.h"

namespace cnerf::pipeline {

/// What a colorizer of this configuration is made for. The folders are those of `ColorizerContext`; empty = none.
[[nodiscard]] ColorizerContext colorizer_context(const Config& config, const std::filesystem::path& working_folder,
                                                 const std::filesystem::path& cache_folder, Observer& observer);
/// The colorizer the configuration names. What it learns is kept in the run's folder, for the next time.
/// @throws UsageError, MissingInputError, ColorizerError.
[[nodiscard]] std::unique_ptr<Colorizer> colorizer_of(const RunContext& context, Observer& observer);

/// The take whose configuration a colorization starts from: one that is gone on with has its own. Empty: the run's.
[[nodiscard]] std::string configured_take(const RunDirectory& directory, const std::string& named, bool resume);
/// The take a colorization goes to: the named one, else a free name after the colorizer's kind; with `resume` the take
/// that was not finished. Rank 0 says which.
/// @throws UsageError  when the named take is finished and neither is set, or both are.
[[nodiscard]] std::string take_to_write(const RunContext& context, const std::string& named,
                                        const ExistingOutput& existing);
/// The take of a whole run: with `resume` the current one, else one that the run's own colorizer began. Takes that
/// other commands began are theirs. Rank 0 says which.
[[nodiscard]] std::string take_of_run(const RunContext& context, const ExistingOutput& existing);

/// Base candidates as pictures.
/// @param views  of the run's stage 1; null = traced anew
[[nodiscard]] std::vector<Tile> base_candidates(const RunContext& context, ViewCache* views, const Engines& engines,
                                                Observer& observer);
/// Writes the gallery of base candidates beside the takes, bases.png; touches none of them.
void show_bases(const RunContext& context, const Engines& engines, Observer& observer);

struct ColorizeJob {
  std::string take;
  ExistingOutput existing;
  Colorizer* colorizer = nullptr;                     ///< null: `colorizer_of` the run is made when it is needed
  ViewCache* views = nullptr;                         ///< of the run's stage 1; null = one of its own
  std::function<void(const ColorModel&)> watch = {};  ///< as Stage2Job has it
};

/// Stage 2 into a take, unless it is finished. Makes it the current one.
/// @throws  as `train_stage2`, `load_known_colors` and `colorizer_of`.
void colorize_step(const RunContext& context, const ColorizeJob& job, const Engines& engines, Observer& observer);

}  // namespace cnerf::pipeline
