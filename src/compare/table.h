#pragma once
/// The paper's table: means over seeds and captures of what the methods' cells hold, who beats whom, and how long
/// fields train.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "src/compare/cell.h"

namespace cnerf::compare {

/// A number of the table.
struct Column {
  const char* name;   ///< "lpips"
  const char* title;  ///< "LPIPS"
  int better;         ///< 1: higher is better, -1: lower is, 0: neither
  int digits;         ///< behind the point
  const char* help;
  std::optional<double> (*value)(const Cell& cell);
};
[[nodiscard]] std::span<const Column> columns();
[[nodiscard]] const Column& column_named(const std::string& name);

/// Mean over seeds and its 95 % confidence interval.
struct Estimate {
  double mean = 0;
  int n = 0;
  std::optional<double> half_width;  ///< Student's t with n - 1 degrees of freedom; empty for a single value

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("mean", self.mean);
    v("n", self.n);
    v("ci95", self.half_width);
  }
};
/// @return  empty for no values.
[[nodiscard]] std::optional<Estimate> estimate(std::span<const double> values);
/// "20.50 ± 0.12"; empty where there is nothing.
[[nodiscard]] std::string text_of(const std::optional<Estimate>& value, int digits);

/// A method's row, of one capture or of all together (then a value is the mean over captures of one seed, where each
/// capture has one).
struct Row {
  std::string method;
  std::string error;                             ///< of the first cell that failed
  std::vector<std::optional<Estimate>> columns;  ///< as `columns()`
};
/// @param capture  empty = all captures
[[nodiscard]] std::vector<Row> table_rows(std::span<const Cell> cells, const std::string& capture);

/// How often the own method is the better one, over pairs of equal capture and seed.
struct Duel {
  std::string method, column;
  int wins = 0, pairs = 0;
  double mean_gain = 0;  ///< of the own method, > 0 = better

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("against", self.method);
    v("column", self.column);
    v("wins", self.wins);
    v("pairs", self.pairs);
    v("mean_gain", self.mean_gain);
  }
};
/// Against each other method that sees the same colorizer, in the columns that the claims name: LPIPS, colourfulness
/// difference, consistency and PSNR.
[[nodiscard]] std::vector<Duel> duels(std::span<const Cell> cells);

/// What a training came to.
struct TrainingEnd {
  double seconds = 0, value = 0;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("seconds", self.seconds);
    v("value", self.value);
  }
};
/// How long two fields train until they are as good as each other: means over the seeds that both have.
struct TrainingRace {
  std::string capture;
  int stage = 1;  ///< 1: PSNR of luminance, dB; 2: ab error
  int seeds = 0;
  TrainingEnd grid, field;      ///< of the hash grid, and of the other field
  int reached = 0;              ///< seeds in which the other field became as good as the hash grid's end
  double reached_after = 0;     ///< seconds that it took them; 0 where none did
  double grid_after_tenth = 0;  ///< the hash grid after a tenth of the other field's time

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("capture", self.capture);
    v("stage", self.stage);
    v("seeds", self.seeds);
    v("hash_grid", self.grid);
    v("mlp", self.field);
    v("reached", self.reached);
    v("reached_after", self.reached_after);
    v("hash_grid_after_tenth", self.grid_after_tenth);
  }
};
/// The paper's field against the hash grid, for each capture and stage that both were measured in.
[[nodiscard]] std::vector<TrainingRace> training_races(std::span<const Cell> cells);

/// Captures in order of appearance.
[[nodiscard]] std::vector<std::string> captures_of(std::span<const Cell> cells);

}  // namespace cnerf::compare
