#pragma once
/// The paper's table: what each method measures on each capture with each seed, and the means of that.

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "src/compare/consistency.h"
#include "src/compare/learning_curve.h"
#include "src/evaluate/evaluate.h"

namespace cnerf::compare {

/// One method on one capture with one seed.
struct ComparisonCell {
  std::string capture, method;
  int seed = 1;
  std::string settings;  ///< digest of all that went in; a cell of other settings is made anew
  std::string error;     ///< why the method failed; empty = it did not
  Metrics metrics;       ///< over the evaluated views
  Consistency short_range, long_range;
  int accepted = 0, rejected = 0;  ///< answers of the colorizer
  double seconds = 0;              ///< that stage 2 took
  /// Of `colornerf` and of methods with a field of their own: PSNR of luminance during stage 1, ab error during
  /// stage 2.
  std::vector<LearningPoint> stage1_curve, stage2_curve;
};

[[nodiscard]] std::string to_json(const ComparisonCell& cell);
/// @throws InputError  naming the file and the field.
[[nodiscard]] ComparisonCell read_cell(const std::filesystem::path& file);

/// A number of the table.
struct ComparisonColumn {
  const char* name;   ///< "lpips"
  const char* title;  ///< "LPIPS"
  int better;         ///< 1: higher is better, -1: lower is, 0: neither
  int digits;         ///< behind the point
  const char* help;
  std::optional<double> (*value)(const ComparisonCell& cell);
};
[[nodiscard]] std::span<const ComparisonColumn> comparison_columns();

/// Mean over seeds and its 95 % confidence interval.
struct Estimate {
  double mean = 0;
  double half_width = 0;  ///< Student's t with n - 1 degrees of freedom; 0 for a single value
  int n = 0;
};
/// @return  nothing for no values.
[[nodiscard]] std::optional<Estimate> estimate(std::span<const double> values);

/// Rows of one capture, or of all together (then a value is the mean over captures of one seed).
struct ComparisonRow {
  std::string method;
  std::string error;                             ///< of the first cell that failed
  std::vector<std::optional<Estimate>> columns;  ///< as `comparison_columns`
};
/// @param capture  empty = all captures of which every cell of a method is there
[[nodiscard]] std::vector<ComparisonRow> table_rows(std::span<const ComparisonCell> cells, const std::string& capture);

/// How often the own method is the better one, over pairs of equal capture and seed.
struct Duel {
  std::string method;
  const ComparisonColumn* column = nullptr;
  int wins = 0, pairs = 0;
  double mean_gain = 0;  ///< of the own method, > 0 = better
};
/// Against each other method that sees the same colorizer, in the columns that the claims name: LPIPS, colourfulness
/// difference, consistency and PSNR.
[[nodiscard]] std::vector<Duel> duels(std::span<const ComparisonCell> cells);

/// How long two fields train until they are as good as each other: means over the seeds that both have.
struct TrainingRace {
  std::string capture;
  int stage = 1;  ///< 1: PSNR of luminance, dB; 2: ab error
  int seeds = 0;
  double grid_seconds = 0, grid_value = 0;    ///< the hash grid's whole training, and what it came to
  double field_seconds = 0, field_value = 0;  ///< the other field's
  int reached = 0;                            ///< seeds in which the other field became as good as the hash grid's end
  double reached_after = 0;                   ///< seconds that it took them; 0 where none did
  double grid_after_tenth = 0;                ///< the hash grid after a tenth of the other field's time
};
/// The paper's field against the hash grid, for each capture and stage that both were measured in.
[[nodiscard]] std::vector<TrainingRace> training_races(std::span<const ComparisonCell> cells);

/// What a comparison was made of.
struct ComparisonSummary {
  std::string colorizer;  ///< spec
  std::string lpips;      ///< network; empty = not measured
  std::string command_line;
};

/// {"schema_version", "colorizer", "lpips", "command_line", "columns", "tables": [{"capture", "rows"}], "duels",
/// "cells"}
[[nodiscard]] std::string table_json(std::span<const ComparisonCell> cells, const ComparisonSummary& summary);
/// `training_races` as a table; empty where there are none.
[[nodiscard]] std::string races_markdown(std::span<const ComparisonCell> cells);
/// The same for people; `table_markdown` names each number's meaning below the tables.
[[nodiscard]] std::string table_markdown(std::span<const ComparisonCell> cells, const ComparisonSummary& summary);

/// Captures in order of appearance.
[[nodiscard]] std::vector<std::string> captures_of(std::span<const ComparisonCell> cells);

}  // namespace cnerf::compare
