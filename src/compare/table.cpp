#include "src/compare/table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/compare/methods.h"

namespace cnerf::compare {
namespace {
using Json = nlohmann::ordered_json;

constexpr int kTableSchemaVersion = 1;
constexpr const char *kOwnMethod = "colornerf", *kOwnField = "positional-encoding";

/// Mean of |difference| over views: views that are too colourful do not make up for those that are too grey.
std::optional<double> colourfulness_gap(const ComparisonCell& cell) {
  double sum = 0;
  int count = 0;
  for (const ViewMetrics& view : cell.metrics.views) {
    if (!view.colourfulness_difference) continue;
    sum += std::abs(*view.colourfulness_difference);
    ++count;
  }
  return count > 0 ? std::optional(sum / count) : std::nullopt;
}

std::optional<double> if_any(const Consistency& found, double Consistency::*value) {
  return found.pixels > 0 ? std::optional(found.*value) : std::nullopt;
}

std::optional<double> acceptance(const ComparisonCell& cell) {
  const int asked = cell.accepted + cell.rejected;
  return asked > 0 ? std::optional(100.0 * cell.accepted / asked) : std::nullopt;
}

constexpr ComparisonColumn kColumns[] = {
    {"psnr_rgb", "PSNR", 1, 2, "dB, of sRGB-encoded values of all three channels, mean over views",
     [](const ComparisonCell& c) { return c.metrics.mean.psnr_rgb; }},
    {"ssim_rgb", "SSIM", 1, 3, "Wang et al. 2004: Gaussian window 11 x 11, sigma 1.5; mean of the encoded channels",
     [](const ComparisonCell& c) { return c.metrics.mean.ssim_rgb; }},
    {"lpips", "LPIPS", -1, 3, "Zhang et al. 2018, version 0.1",
     [](const ComparisonCell& c) { return c.metrics.mean.lpips; }},
    {"colourfulness", "Colourful", 0, 2, "Hasler and Suesstrunk 2003",
     [](const ComparisonCell& c) { return c.metrics.mean.colourfulness; }},
    {"colourfulness_gap", "Δ Colourful", -1, 2, "mean over views of the absolute difference to the truth's",
     colourfulness_gap},
    {"ab_error", "ab error", -1, 2, "mean Lab ab distance to the truth",
     [](const ComparisonCell& c) { return c.metrics.mean.ab_error; }},
    {"short_range", "Short", -1, 2, "cross-view consistency, neighbouring frames of the turntable: mean ab distance",
     [](const ComparisonCell& c) { return if_any(c.short_range, &Consistency::mean); }},
    {"short_range_p95", "Short 95 %", -1, 2, "its 95th percentile",
     [](const ComparisonCell& c) { return if_any(c.short_range, &Consistency::p95); }},
    {"long_range", "Long", -1, 2, "the same for frames an eighth of the turntable apart",
     [](const ComparisonCell& c) { return if_any(c.long_range, &Consistency::mean); }},
    {"long_range_p95", "Long 95 %", -1, 2, "its 95th percentile",
     [](const ComparisonCell& c) { return if_any(c.long_range, &Consistency::p95); }},
    {"short_relative", "Short %", -1, 1, "short-range mean distance in percent of the mean chroma: grey hides flicker",
     [](const ComparisonCell& c) { return c.short_range.relative(); }},
    {"long_relative", "Long %", -1, 1, "the same of the long range",
     [](const ComparisonCell& c) { return c.long_range.relative(); }},
    {"acceptance", "Accepted", 0, 0, "percent of the colorizer's answers that purification let pass", acceptance},
    {"seconds", "Stage 2", 0, 0, "seconds",
     [](const ComparisonCell& c) { return c.seconds > 0 ? std::optional(c.seconds) : std::nullopt; }},
};
constexpr const char* kClaims[] = {"lpips",          "colourfulness_gap", "short_range", "long_range",
                                   "short_relative", "long_relative",     "psnr_rgb"};

constexpr const char* kRacesMeaning =
    "The hash grid (`colornerf`) against the paper's field (`positional-encoding`), on the same held-out pixels while "
    "they train: PSNR of luminance in stage 1, ab error in stage 2. Seconds of training alone; means over seeds.";

Json json_of(const Consistency& found) {
  Json json = {{"pixels", found.pixels}};
  if (found.pixels > 0) json.update({{"mean", found.mean}, {"p95", found.p95}, {"chroma", found.chroma}});
  return json;
}

Consistency consistency_of(const Json& json) {
  return {json.value("mean", 0.0), json.value("p95", 0.0), json.at("pixels").get<std::size_t>(),
          json.value("chroma", 0.0)};
}

/// [[seconds, value], ...]
Json json_of(const std::vector<LearningPoint>& curve) {
  Json json = Json::array();
  for (const LearningPoint& point : curve) json.push_back({point.seconds, point.value});
  return json;
}

std::vector<LearningPoint> curve_of(const Json& json) {
  std::vector<LearningPoint> curve;
  for (const Json& point : json) curve.push_back({point.at(0), point.at(1)});
  return curve;
}

ViewMetrics view_metrics_of(const Json& json) {
  ViewMetrics metrics;
  metrics.view = json.value("view", "");
  ViewMetrics::visit(metrics, [&](const char* name, std::optional<double>& value) {
    if (const auto found = json.find(name); found != json.end()) value = found->get<double>();
  });
  return metrics;
}

/// Upper 2.5 % point of Student's t.
double student_t(int degrees) {
  constexpr double kExact[] = {12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228};
  if (degrees <= 10) return kExact[degrees - 1];
  return 1.960 + 2.37 / degrees + 2.82 / (double(degrees) * degrees);  // within 0.002 of the tables
}

std::vector<std::string> methods_of(std::span<const ComparisonCell> cells) {
  std::vector<std::string> present;
  for (const std::string& name : method_names()) {
    if (std::ranges::find(cells, name, &ComparisonCell::method) != cells.end()) present.push_back(name);
  }
  for (const ComparisonCell& cell : cells) {
    if (std::ranges::find(present, cell.method) == present.end()) present.push_back(cell.method);
  }
  return present;
}

/// One value a seed: of the capture, or the mean over the captures that have one of that seed.
std::vector<double> values_by_seed(std::span<const ComparisonCell> cells, const std::string& method,
                                   const std::string& capture, const ComparisonColumn& column) {
  std::vector<std::pair<int, std::vector<double>>> seeds;
  for (const ComparisonCell& cell : cells) {
    if (cell.method != method || !cell.error.empty() || (!capture.empty() && cell.capture != capture)) continue;
    const std::optional<double> value = column.value(cell);
    if (!value) continue;
    auto seed = std::ranges::find(seeds, cell.seed, &std::pair<int, std::vector<double>>::first);
    if (seed == seeds.end()) seed = seeds.insert(seeds.end(), {cell.seed, {}});
    seed->second.push_back(*value);
  }
  std::vector<double> means;
  for (const auto& [seed, values] : seeds) {
    means.push_back(std::accumulate(values.begin(), values.end(), 0.0) / double(values.size()));
  }
  return means;
}

bool is_rival(const std::string& method) {
  return method != kOwnMethod && method != "grey" && method != "oracle";
}

std::string text_of(const std::optional<Estimate>& value, int digits) {
  if (!value) return "";
  const std::string mean = fmt::format("{:.{}f}", value->mean, digits);
  return value->n > 1 ? fmt::format("{} ± {:.{}f}", mean, value->half_width, digits) : mean;
}

std::string markdown_rows(const std::vector<ComparisonRow>& rows) {
  std::string text = "| Method |", line = "|---|";
  for (const ComparisonColumn& column : kColumns) {
    text += fmt::format(" {}{} |", column.title, column.better > 0 ? " ↑" : column.better < 0 ? " ↓" : "");
    line += "---|";
  }
  text += "\n" + line + "\n";
  for (const ComparisonRow& row : rows) {
    text += "| " + row.method + " |";
    for (std::size_t c = 0; c < row.columns.size(); ++c)
      text += " " + text_of(row.columns[c], kColumns[c].digits) + " |";
    text += "\n";
  }
  for (const ComparisonRow& row : rows) {
    if (!row.error.empty()) text += "\n`" + row.method + "` failed: " + row.error + "\n";
  }
  return text;
}

}  // namespace

std::span<const ComparisonColumn> comparison_columns() {
  return kColumns;
}

std::string to_json(const ComparisonCell& cell) {
  Json json = {{"capture", cell.capture}, {"method", cell.method}, {"seed", cell.seed}, {"settings", cell.settings}};
  if (!cell.error.empty()) json["error"] = cell.error;
  json["metrics"] = Json::parse(to_json(cell.metrics));
  json["short_range"] = json_of(cell.short_range);
  json["long_range"] = json_of(cell.long_range);
  json["accepted"] = cell.accepted;
  json["rejected"] = cell.rejected;
  json["seconds"] = cell.seconds;
  if (!cell.stage1_curve.empty()) json["stage1_curve"] = json_of(cell.stage1_curve);
  if (!cell.stage2_curve.empty()) json["stage2_curve"] = json_of(cell.stage2_curve);
  return json.dump(2) + "\n";
}

ComparisonCell read_cell(const std::filesystem::path& file) {
  try {
    const Json json = Json::parse(read_text_file(file));
    ComparisonCell cell;
    cell.capture = json.at("capture");
    cell.method = json.at("method");
    cell.seed = json.at("seed");
    cell.settings = json.at("settings");
    cell.error = json.value("error", "");
    const Json& metrics = json.at("metrics");
    cell.metrics = {
        metrics.at("split"), metrics.at("take"), metrics.at("colorizer"), view_metrics_of(metrics.at("mean")), {}};
    for (const Json& view : metrics.at("views")) cell.metrics.views.push_back(view_metrics_of(view));
    cell.short_range = consistency_of(json.at("short_range"));
    cell.long_range = consistency_of(json.at("long_range"));
    cell.accepted = json.at("accepted");
    cell.rejected = json.at("rejected");
    cell.seconds = json.at("seconds");
    cell.stage1_curve = curve_of(json.value("stage1_curve", Json::array()));
    cell.stage2_curve = curve_of(json.value("stage2_curve", Json::array()));
    return cell;
  } catch (const nlohmann::json::exception& problem) {
    throw InputError(file.string() + ": " + problem.what());
  }
}

std::optional<Estimate> estimate(std::span<const double> values) {
  if (values.empty()) return std::nullopt;
  const auto n = int(values.size());
  Estimate result{std::accumulate(values.begin(), values.end(), 0.0) / n, 0, n};
  if (n == 1) return result;
  double squares = 0;
  for (const double value : values) squares += (value - result.mean) * (value - result.mean);
  result.half_width = student_t(n - 1) * std::sqrt(squares / (n - 1) / n);
  return result;
}

std::vector<std::string> captures_of(std::span<const ComparisonCell> cells) {
  std::vector<std::string> captures;
  for (const ComparisonCell& cell : cells) {
    if (std::ranges::find(captures, cell.capture) == captures.end()) captures.push_back(cell.capture);
  }
  return captures;
}

std::vector<ComparisonRow> table_rows(std::span<const ComparisonCell> cells, const std::string& capture) {
  std::vector<ComparisonRow> rows;
  for (const std::string& method : methods_of(cells)) {
    ComparisonRow row{method, {}, {}};
    for (const ComparisonCell& cell : cells) {
      const bool is_of_row = cell.method == method && (capture.empty() || cell.capture == capture);
      if (is_of_row && row.error.empty()) row.error = cell.error;
    }
    for (const ComparisonColumn& column : kColumns) {
      row.columns.push_back(estimate(values_by_seed(cells, method, capture, column)));
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

std::vector<Duel> duels(std::span<const ComparisonCell> cells) {
  std::vector<Duel> all;
  for (const std::string& method : methods_of(cells)) {
    if (!is_rival(method)) continue;
    for (const char* name : kClaims) {
      const auto* column = std::ranges::find(kColumns, std::string_view(name),
                                             [](const ComparisonColumn& c) { return std::string_view(c.name); });
      Duel duel{method, column, 0, 0, 0};
      for (const ComparisonCell& own : cells) {
        if (own.method != kOwnMethod || !own.error.empty()) continue;
        for (const ComparisonCell& other : cells) {
          const bool is_pair = other.method == method && other.capture == own.capture && other.seed == own.seed;
          if (!is_pair || !other.error.empty()) continue;
          const auto ours = column->value(own), theirs = column->value(other);
          if (!ours || !theirs) continue;
          const double gain = column->better * (*ours - *theirs);
          duel.wins += gain > 0 ? 1 : 0;
          duel.pairs += 1;
          duel.mean_gain += gain;
        }
      }
      if (duel.pairs == 0) continue;
      duel.mean_gain /= duel.pairs;
      all.push_back(duel);
    }
  }
  return all;
}

std::vector<TrainingRace> training_races(std::span<const ComparisonCell> cells) {
  std::vector<TrainingRace> races;
  for (const std::string& capture : captures_of(cells)) {
    for (const int stage : {1, 2}) {
      const int better = stage == 1 ? 1 : -1;
      TrainingRace race{.capture = capture, .stage = stage};
      for (const ComparisonCell& grid : cells) {
        if (grid.capture != capture || grid.method != kOwnMethod || !grid.error.empty()) continue;
        for (const ComparisonCell& field : cells) {
          const bool is_pair = field.capture == capture && field.method == kOwnField && field.seed == grid.seed;
          const auto& ours = stage == 1 ? grid.stage1_curve : grid.stage2_curve;
          const auto& theirs = stage == 1 ? field.stage1_curve : field.stage2_curve;
          if (!is_pair || !field.error.empty() || ours.empty() || theirs.empty()) continue;
          ++race.seeds;
          race.grid_seconds += ours.back().seconds;
          race.grid_value += ours.back().value;
          race.field_seconds += theirs.back().seconds;
          race.field_value += theirs.back().value;
          race.grid_after_tenth += value_at(ours, theirs.back().seconds / 10);
          const std::optional<double> reached = seconds_to(theirs, ours.back().value, better);
          race.reached += reached ? 1 : 0;
          race.reached_after += reached.value_or(0);
        }
      }
      if (race.seeds == 0) continue;
      for (double* sum :
           {&race.grid_seconds, &race.grid_value, &race.field_seconds, &race.field_value, &race.grid_after_tenth}) {
        *sum /= race.seeds;
      }
      race.reached_after /= std::max(race.reached, 1);
      races.push_back(std::move(race));
    }
  }
  return races;
}

std::string races_markdown(std::span<const ComparisonCell> cells) {
  const std::vector<TrainingRace> races = training_races(cells);
  if (races.empty()) return "";
  std::string text =
      "| Capture | Stage | hash grid | comes to | MLP | comes to | of the hash grid's time | as good as the hash grid "
      "after | hash grid after 1/10 of the MLP's time |\n|---|---|---|---|---|---|---|---|---|\n";
  for (const TrainingRace& race : races) {
    const char* unit = race.stage == 1 ? " dB" : " ab";
    const std::string reached = race.reached == 0 ? "never"
                                : race.reached == race.seeds
                                    ? fmt::format("{:.1f} s", race.reached_after)
                                    : fmt::format("{:.1f} s in {} of {}", race.reached_after, race.reached, race.seeds);
    text +=
        fmt::format("| {} | {} | {:.1f} s | {:.2f}{} | {:.1f} s | {:.2f}{} | {:.1f} | {} | {:.2f}{} |\n", race.capture,
                    race.stage, race.grid_seconds, race.grid_value, unit, race.field_seconds, race.field_value, unit,
                    race.field_seconds / std::max(race.grid_seconds, 1e-9), reached, race.grid_after_tenth, unit);
  }
  return text;
}

std::string table_json(std::span<const ComparisonCell> cells, const ComparisonSummary& summary) {
  Json json = {{"schema_version", kTableSchemaVersion},
               {"colorizer", summary.colorizer},
               {"lpips", summary.lpips},
               {"command_line", summary.command_line}};
  for (const ComparisonColumn& column : kColumns) {
    json["columns"].push_back(
        {{"name", column.name}, {"title", column.title}, {"better", column.better}, {"help", column.help}});
  }
  std::vector<std::string> captures = captures_of(cells);
  if (captures.size() > 1) captures.emplace_back();
  for (const std::string& capture : captures) {
    Json table = {{"capture", capture.empty() ? "all" : capture}, {"rows", Json::array()}};
    for (const ComparisonRow& row : table_rows(cells, capture)) {
      Json entry = {{"method", row.method}};
      if (!row.error.empty()) entry["error"] = row.error;
      for (std::size_t c = 0; c < row.columns.size(); ++c) {
        if (!row.columns[c]) continue;
        entry[kColumns[c].name] = {{"mean", row.columns[c]->mean}, {"n", row.columns[c]->n}};
        if (row.columns[c]->n > 1) entry[kColumns[c].name]["ci95"] = row.columns[c]->half_width;
      }
      table["rows"].push_back(std::move(entry));
    }
    json["tables"].push_back(std::move(table));
  }
  json["duels"] = Json::array();
  for (const Duel& duel : duels(cells)) {
    json["duels"].push_back({{"against", duel.method},
                             {"column", duel.column->name},
                             {"wins", duel.wins},
                             {"pairs", duel.pairs},
                             {"mean_gain", duel.mean_gain}});
  }
  for (const TrainingRace& race : training_races(cells)) {
    json["training_times"].push_back({{"capture", race.capture},
                                      {"stage", race.stage},
                                      {"seeds", race.seeds},
                                      {"hash_grid", {{"seconds", race.grid_seconds}, {"value", race.grid_value}}},
                                      {"mlp", {{"seconds", race.field_seconds}, {"value", race.field_value}}},
                                      {"reached", race.reached},
                                      {"reached_after", race.reached_after},
                                      {"hash_grid_after_tenth", race.grid_after_tenth}});
  }
  json["cells"] = Json::array();
  for (const ComparisonCell& cell : cells) json["cells"].push_back(Json::parse(to_json(cell)));
  return json.dump(2) + "\n";
}

std::string table_markdown(std::span<const ComparisonCell> cells, const ComparisonSummary& summary) {
  std::string text = "Colorizer: `" + summary.colorizer + "`" +
                     (summary.lpips.empty() ? "; LPIPS not measured (--lpips-weights)" : "; LPIPS: " + summary.lpips) +
                     "\n";
  for (const std::string& capture : captures_of(cells)) {
    text += "\n## " + capture + "\n\n" + markdown_rows(table_rows(cells, capture));
  }
  if (captures_of(cells).size() > 1) text += "\n## All captures\n\n" + markdown_rows(table_rows(cells, ""));
  const std::vector<Duel> all = duels(cells);
  if (!all.empty()) {
    text +=
        "\n## colornerf against the others\n\n"
        "Pairs of equal capture and seed in which colornerf is better, and by how much on average (above 0: "
        "better).\n\n| Against | Number | Better in | Mean gain |\n|---|---|---|---|\n";
    for (const Duel& duel : all) {
      text += fmt::format("| {} | {} | {} of {} | {:+.{}f} |\n", duel.method, duel.column->title, duel.wins, duel.pairs,
                          duel.mean_gain, duel.column->digits + 1);
    }
  }
  if (const std::string races = races_markdown(cells); !races.empty()) {
    text += "\n## Training times\n\n" + std::string(kRacesMeaning) + "\n\n" + races;
  }
  text += "\n## What the numbers mean\n\n";
  for (const ComparisonColumn& column : kColumns) text += fmt::format("* **{}**: {}\n", column.title, column.help);
  text += "* ±: 95 % confidence interval of the mean over seeds (Student's t)\n";
  return text;
}

}  // namespace cnerf::compare
