#include "src/compare/table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "src/base/check.h"
#include "src/compare/methods.h"

namespace cnerf::compare {
namespace {

constexpr const char *kOwnMethod = "colornerf", *kOwnField = "positional-encoding";

/// Mean of |difference| over views: views that are too colourful do not make up for those that are too grey.
std::optional<double> colorfulness_gap(const Cell& cell) {
  double sum = 0;
  int count = 0;
  for (const ViewMetrics& view : cell.metrics.views) {
    if (!view.colorfulness_difference) continue;
    sum += std::abs(*view.colorfulness_difference);
    ++count;
  }
  return count > 0 ? std::optional(sum / count) : std::nullopt;
}

std::optional<double> if_any(const Consistency& found, double Consistency::*value) {
  return found.pixels > 0 ? std::optional(found.*value) : std::nullopt;
}

std::optional<double> acceptance(const Cell& cell) {
  const int asked = cell.accepted + cell.rejected;
  return asked > 0 ? std::optional(100.0 * cell.accepted / asked) : std::nullopt;
}

constexpr Column kColumns[] = {
    {"psnr_rgb", "PSNR", 1, 2, "dB, of sRGB-encoded values of all three channels, mean over views",
     [](const Cell& c) { return c.metrics.mean.psnr_rgb; }},
    {"ssim_rgb", "SSIM", 1, 3, "Wang et al. 2004: Gaussian window 11 x 11, sigma 1.5; mean of the encoded channels",
     [](const Cell& c) { return c.metrics.mean.ssim_rgb; }},
    {"lpips", "LPIPS", -1, 3, "Zhang et al. 2018, version 0.1", [](const Cell& c) { return c.metrics.mean.lpips; }},
    {"feature_distance", "FID-like", -1, 1,
     "squared Fréchet distance of the optional encoder's features, ours to the truth's; empty where it is not "
     "installed",
     [](const Cell& c) { return c.metrics.feature_distance; }},
    {"colourfulness", "Colourful", 0, 2, "Hasler and Suesstrunk 2003",
     [](const Cell& c) { return c.metrics.mean.colorfulness; }},
    {"colourfulness_gap", "Δ Colourful", -1, 2, "mean over views of the absolute difference to the truth's",
     colorfulness_gap},
    {"ab_error", "ab error", -1, 2, "mean Lab ab distance to the truth",
     [](const Cell& c) { return c.metrics.mean.ab_error; }},
    {"short_range", "Short", -1, 2, "cross-view consistency, neighbouring frames of the turntable: mean ab distance",
     [](const Cell& c) { return if_any(c.short_range, &Consistency::mean); }},
    {"short_range_p95", "Short 95 %", -1, 2, "its 95th percentile",
     [](const Cell& c) { return if_any(c.short_range, &Consistency::p95); }},
    {"long_range", "Long", -1, 2, "the same for frames an eighth of the turntable apart",
     [](const Cell& c) { return if_any(c.long_range, &Consistency::mean); }},
    {"long_range_p95", "Long 95 %", -1, 2, "its 95th percentile",
     [](const Cell& c) { return if_any(c.long_range, &Consistency::p95); }},
    {"short_relative", "Short %", -1, 1, "short-range mean distance in percent of the mean chroma: grey hides flicker",
     [](const Cell& c) { return c.short_range.relative(); }},
    {"long_relative", "Long %", -1, 1, "the same of the long range",
     [](const Cell& c) { return c.long_range.relative(); }},
    {"acceptance", "Accepted", 0, 0, "percent of the colorizer's answers that purification let pass", acceptance},
    {"seconds", "Stage 2", 0, 0, "seconds",
     [](const Cell& c) { return c.seconds > 0 ? std::optional(c.seconds) : std::nullopt; }},
};
constexpr const char* kClaims[] = {"lpips",          "colourfulness_gap", "short_range", "long_range",
                                   "short_relative", "long_relative",     "psnr_rgb"};

/// Upper 2.5 % point of Student's t.
double student_t(int degrees) {
  constexpr double kExact[] = {12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228};
  if (degrees <= 10) return kExact[degrees - 1];
  return 1.960 + 2.37 / degrees + 2.82 / (double(degrees) * degrees);  // within 0.002 of the tables
}

double mean_of(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / double(values.size());
}

std::vector<std::string> methods_of(std::span<const Cell> cells) {
  std::vector<std::string> present;
  for (const std::string& name : method_names()) {
    if (std::ranges::find(cells, name, &Cell::method) != cells.end()) present.push_back(name);
  }
  for (const Cell& cell : cells) {
    if (std::ranges::find(present, cell.method) == present.end()) present.push_back(cell.method);
  }
  return present;
}

/// One value per seed: of the capture, or the mean over all captures. A seed without a value of each of them has none:
/// a method that failed on the hardest capture would be the best.
std::vector<double> values_by_seed(std::span<const Cell> cells, const std::string& method, const std::string& capture,
                                   const Column& column) {
  std::vector<std::pair<int, std::vector<double>>> seeds;
  for (const Cell& cell : cells) {
    if (cell.method != method || !cell.error.empty() || (!capture.empty() && cell.capture != capture)) continue;
    const std::optional<double> value = column.value(cell);
    if (!value) continue;
    auto seed = std::ranges::find(seeds, cell.seed, &std::pair<int, std::vector<double>>::first);
    if (seed == seeds.end()) seed = seeds.insert(seeds.end(), {cell.seed, {}});
    seed->second.push_back(*value);
  }
  const std::size_t expected = capture.empty() ? captures_of(cells).size() : 1;
  std::vector<double> means;
  for (const auto& [seed, values] : seeds) {
    if (values.size() == expected) means.push_back(mean_of(values));
  }
  return means;
}

bool is_rival(const std::string& method) {
  return method != kOwnMethod && method != "grey" && method != "oracle";
}

/// Calls `use(own, other)` for the cells of the own and another method of equal capture and seed that did not fail.
template <typename Use>
void for_pairs(std::span<const Cell> cells, const std::string& method, Use&& use) {
  for (const Cell& own : cells) {
    if (own.method != kOwnMethod || !own.error.empty()) continue;
    for (const Cell& other : cells) {
      const bool is_pair = other.method == method && other.capture == own.capture && other.seed == own.seed;
      if (is_pair && other.error.empty()) use(own, other);
    }
  }
}

Duel duel_of(std::span<const Cell> cells, const std::string& method, const Column& column) {
  Duel duel{method, column.name};
  for_pairs(cells, method, [&](const Cell& own, const Cell& other) {
    const auto ours = column.value(own), theirs = column.value(other);
    if (!ours || !theirs) return;
    const double gain = column.better * (*ours - *theirs);
    duel.wins += gain > 0 ? 1 : 0;
    duel.pairs += 1;
    duel.mean_gain += gain;
  });
  duel.mean_gain /= std::max(duel.pairs, 1);
  return duel;
}

TrainingRace race_of(std::span<const Cell> cells, const std::string& capture, int stage) {
  TrainingRace race;
  race.capture = capture;
  race.stage = stage;
  for_pairs(cells, kOwnField, [&](const Cell& own, const Cell& other) {
    const auto& ours = stage == 1 ? own.stage1_curve : own.stage2_curve;
    const auto& theirs = stage == 1 ? other.stage1_curve : other.stage2_curve;
    if (own.capture != capture || ours.empty() || theirs.empty()) return;
    ++race.seeds;
    race.grid.seconds += ours.back().seconds;
    race.grid.value += ours.back().value;
    race.field.seconds += theirs.back().seconds;
    race.field.value += theirs.back().value;
    race.grid_after_tenth += value_at(ours, theirs.back().seconds / 10);
    const std::optional<double> reached = seconds_to(theirs, ours.back().value, stage == 1 ? 1 : -1);
    race.reached += reached ? 1 : 0;
    race.reached_after += reached.value_or(0);
  });
  for (double* sum :
       {&race.grid.seconds, &race.grid.value, &race.field.seconds, &race.field.value, &race.grid_after_tenth}) {
    *sum /= std::max(race.seeds, 1);
  }
  race.reached_after /= std::max(race.reached, 1);
  return race;
}

}  // namespace

std::span<const Column> columns() {
  return kColumns;
}

const Column& column_named(const std::string& name) {
  const auto* column = std::ranges::find_if(kColumns, [&](const Column& each) { return each.name == name; });
  CNERF_CHECK(column != std::end(kColumns), "no column of that name");
  return *column;
}

std::optional<Estimate> estimate(std::span<const double> values) {
  if (values.empty()) return std::nullopt;
  const auto n = int(values.size());
  Estimate result{mean_of({values.begin(), values.end()}), n, {}};
  if (n == 1) return result;
  double squares = 0;
  for (const double value : values) squares += (value - result.mean) * (value - result.mean);
  result.half_width = student_t(n - 1) * std::sqrt(squares / (n - 1) / n);
  return result;
}

std::string text_of(const std::optional<Estimate>& value, int digits) {
  if (!value) return "";
  const std::string mean = fmt::format("{:.{}f}", value->mean, digits);
  return value->half_width ? fmt::format("{} ± {:.{}f}", mean, *value->half_width, digits) : mean;
}

std::vector<std::string> captures_of(std::span<const Cell> cells) {
  std::vector<std::string> captures;
  for (const Cell& cell : cells) {
    if (std::ranges::find(captures, cell.capture) == captures.end()) captures.push_back(cell.capture);
  }
  return captures;
}

std::vector<Row> table_rows(std::span<const Cell> cells, const std::string& capture) {
  std::vector<Row> rows;
  for (const std::string& method : methods_of(cells)) {
    Row row{method, {}, {}};
    for (const Cell& cell : cells) {
      const bool is_of_row = cell.method == method && (capture.empty() || cell.capture == capture);
      if (is_of_row && row.error.empty()) row.error = cell.error;
    }
    for (const Column& column : kColumns) {
      row.columns.push_back(estimate(values_by_seed(cells, method, capture, column)));
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

std::vector<Duel> duels(std::span<const Cell> cells) {
  std::vector<Duel> all;
  for (const std::string& method : methods_of(cells)) {
    for (const char* name : kClaims) {
      const Duel duel = duel_of(cells, method, column_named(name));
      if (is_rival(method) && duel.pairs > 0) all.push_back(duel);
    }
  }
  return all;
}

std::vector<TrainingRace> training_races(std::span<const Cell> cells) {
  std::vector<TrainingRace> races;
  for (const std::string& capture : captures_of(cells)) {
    for (const int stage : {1, 2}) {
      TrainingRace race = race_of(cells, capture, stage);
      if (race.seeds > 0) races.push_back(std::move(race));
    }
  }
  return races;
}

}  // namespace cnerf::compare
