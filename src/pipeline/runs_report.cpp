#include "src/pipeline/runs_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>

#include "src/base/absolute_folder.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/json_record.h"
#include "src/base/text.h"
#include "src/capture/image_io.h"
#include "src/evaluate/evaluate.h"
#include "src/picture/contact_sheet.h"
#include "src/picture/encode.h"
#include "src/pipeline/run_directory.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;
namespace {

constexpr int kSheetColumns = 3;
constexpr int kSheetWidth = 600;  // of a run's own sheet, pixels

struct ReportedRun {
  fs::path folder;
  RunRecord record;
  std::optional<Metrics> metrics;
  double colorize_seconds = 0;  ///< of the take that was evaluated

  [[nodiscard]] std::string name() const { return folder.filename().string(); }
  [[nodiscard]] bool is_finished() const { return record.stage1.finished && metrics.has_value(); }
};

ReportedRun read_run(const fs::path& folder) {
  const RunDirectory directory = RunDirectory::open(absolute_folder(folder));
  ReportedRun run{directory.root(), directory.record(), {}, 0};
  if (fs::exists(directory.metrics_file())) run.metrics = read_record<Metrics>(directory.metrics_file());
  if (run.metrics && !run.metrics->take.empty()) {
    if (const auto take = directory.take_record(run.metrics->take)) run.colorize_seconds = take->stage2.seconds;
  }
  return run;
}

std::string number(const std::optional<double>& value, int digits) {
  return value ? fmt::format("{:.{}f}", *value, digits) : "-";
}

/// Words of files, which hold whatever their writers liked, in a table's cell.
std::string cell(const std::string& text) {
  std::string safe = printable(text);
  for (std::size_t at = 0; (at = safe.find('|', at)) != std::string::npos; at += 2) safe.insert(at, "\\");
  return safe;
}

/// A column that some runs have: empty where a run lacks it.
struct Column {
  std::string title;
  std::function<std::string(const Metrics&)> text;  ///< of a run; empty: it has none
};

/// Beside the luminance as given, and of colours. None is ever shown in place of another.
const std::vector<Column>& further_columns() {
  const auto mean = [](const std::string& title, std::optional<double> ViewMetrics::*field, double scale, int digits) {
    return Column{title, [=](const Metrics& metrics) {
                    const std::optional<double>& value = metrics.mean.*field;
                    return value ? fmt::format("{:.{}f}", scale * *value, digits) : "";
                  }};
  };
  const auto worst = [](const std::string& title, const std::string& name) {
    return Column{title, [=](const Metrics& metrics) {
                    const auto found = metrics.spread.find(name);
                    return found == metrics.spread.end() ? "" : fmt::format("{:.2f}", found->second.worst);
                  }};
  };
  static const std::vector<Column> columns = {
      worst("worst", "psnr_luminance"),
      mean("exposure fitted dB", &ViewMetrics::psnr_luminance_exposure_fitted, 1, 2),
      worst("worst", "psnr_luminance_exposure_fitted"),
      mean("right halves aligned dB", &ViewMetrics::psnr_luminance_aligned, 1, 2),
      worst("worst", "psnr_luminance_aligned"),
      mean("fog before cameras %", &ViewMetrics::near_opacity, 100, 2),
      mean("diversity of colours", &ViewMetrics::color_diversity, 1, 1),
      {"distance of features",
       [](const Metrics& metrics) {
         return metrics.feature_distance ? fmt::format("{:.1f}", *metrics.feature_distance) : "";
       }},
  };
  return columns;
}

std::vector<Column> columns_of(const std::vector<ReportedRun>& runs) {
  std::vector<Column> shown;
  for (const Column& column : further_columns()) {
    const auto has_it = [&](const ReportedRun& run) { return run.metrics && !column.text(*run.metrics).empty(); };
    if (std::ranges::any_of(runs, has_it)) shown.push_back(column);
  }
  return shown;
}

std::string row(const ReportedRun& run, const std::vector<Column>& columns) {
  const Stage1Record& stage1 = run.record.stage1;
  const std::string trained = stage1.finished ? duration_text(stage1.seconds) : "not finished";
  std::string further;
  for (const Column& column : columns) {
    const std::string text = run.metrics ? column.text(*run.metrics) : "";
    further += (text.empty() ? "-" : text) + " | ";
  }
  if (!run.metrics) {
    return fmt::format("| {} | {} | not evaluated | - | - | - | {}- | - | - |\n", cell(run.name()), trained, further);
  }
  const ViewMetrics& mean = run.metrics->mean;
  const std::string take = run.metrics->take.empty() ? "grey" : run.metrics->take;
  return fmt::format("| {} | {} | {} | {} | {} {} | {} | {}{} | {} | {} |\n", cell(run.name()), trained, cell(take),
                     run.colorize_seconds > 0 ? duration_text(run.colorize_seconds) : "-", run.metrics->views.size(),
                     cell(run.metrics->split), number(mean.psnr_luminance, 2), further, number(mean.ssim, 3),
                     number(mean.psnr_rgb, 2), number(mean.ab_error, 2));
}

std::string table_of(const std::vector<ReportedRun>& runs) {
  const std::vector<Column> columns = columns_of(runs);
  std::string titles = "| run | stage 1 | take | stage 2 | views | luminance dB | ", rule = "|---|---|---|---|---|---|";
  for (const Column& column : columns) {
    titles += column.title + " | ";
    rule += "---|";
  }
  std::string table = titles + "SSIM | RGB dB | ab error |\n" + rule + "---|---|---|\n";
  for (const ReportedRun& run : runs) table += row(run, columns);
  return table;
}

nlohmann::ordered_json json_of_runs(const std::vector<ReportedRun>& runs) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const ReportedRun& run : runs) {
    nlohmann::ordered_json entry{{"run", run.folder.string()}, {"record", json_of(run.record)}};
    if (run.metrics) entry["metrics"] = json_of(*run.metrics);
    list.push_back(std::move(entry));
  }
  return {{"runs", std::move(list)}};
}

Picture sheet_of(const std::vector<ReportedRun>& runs) {
  std::vector<Tile> tiles;
  for (const ReportedRun& run : runs) {
    const fs::path file = RunDirectory(run.folder).contact_sheet();
    Tile tile{{}, run.name()};
    if (fs::exists(file)) {
      const LinearImage image = read_linear_image(file, Transfer::kSrgb);
      tile.picture = scaled_down(picture_from_linear(image.width, image.height, image.values), kSheetWidth);
    }
    tiles.push_back(std::move(tile));
  }
  return tiled(tiles, kSheetColumns);
}

}  // namespace

int report_runs(const std::vector<fs::path>& folders, const fs::path& out, Observer& observer) {
  if (folders.empty()) throw UsageError("FOLDER: at least one run is needed");
  std::vector<ReportedRun> runs;
  int finished = 0;
  for (const fs::path& folder : folders) {
    runs.push_back(read_run(folder));
    finished += runs.back().is_finished() ? 1 : 0;
  }
  const std::string table = table_of(runs);
  observer.say(table);
  write_file(out / "table.md", table);
  write_file(out / "table.json", json_of_runs(runs).dump(2) + "\n");
  write_png(out / "contact_sheet.png", sheet_of(runs));
  for (const char* file : {"table.md", "table.json", "contact_sheet.png"}) observer.wrote("report", out / file);
  return finished;
}

}  // namespace cnerf::pipeline
