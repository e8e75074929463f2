#pragma once
/// Runs a comparison: stage 1 once a capture and seed, every method on top of it, and a report of what is there.
///
///   REPORT/table.json, table.md, report.html
///   REPORT/rating_sheet.html, rating_key.json      with --rating-sheet
///   REPORT/runs/CAPTURE/seed-N/stage1.snapshot
///   REPORT/runs/CAPTURE/seed-N/METHOD/             take.snapshot, cell.json, galleries, views/, turntable/
///
/// A cell whose settings are unchanged and that did not fail is not made again: stopping and going on is one command.

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "src/app/reporter.h"
#include "src/capture/capture.h"
#include "src/config/config.h"
#include "src/evaluate/comparison.h"
#include "src/evaluate/comparison_report.h"
#include "src/evaluate/lpips.h"
#include "src/evaluate/methods.h"

namespace cnerf {

struct ComparisonPlan {
  std::vector<std::filesystem::path> captures;
  std::filesystem::path report;  ///< folder
  std::vector<const Method*> methods;
  std::vector<int> seeds;
  std::filesystem::path lpips_weights;  ///< empty = LPIPS is not measured
  std::string command_line;
};

class ComparisonRun {
 public:
  /// Reads the captures, so that what is missing costs no training.
  /// @throws UsageError, MissingInputError, InputError  also for a capture without any colour.
  ComparisonRun(ComparisonPlan plan, Config config, Reporter& reporter);

  /// All cells; a method that fails leaves one that says why.  @throws Interrupted  what is finished stays.
  void run();
  /// Writes the tables and the report.
  void write_report() const;
  /// Writes the rating sheet and its key.
  void write_rating_sheet() const;

 private:
  struct Subject;   ///< a capture and its name
  struct Geometry;  ///< what all methods share that stand on one stage 1

  void run_capture(const Subject& subject, int seed);
  [[nodiscard]] std::string train(const Subject& subject, int seed, const std::filesystem::path& folder) const;
  [[nodiscard]] ComparisonCell run_cell(const Subject& subject, const Method& method, int seed, Geometry& geometry,
                                        const std::string& settings) const;
  void colorize(const Subject& subject, const Method& method, int seed, Geometry& geometry, ComparisonCell& cell) const;
  void look(const Subject& subject, const Method& method, Geometry& geometry, ComparisonCell& cell) const;
  [[nodiscard]] std::unique_ptr<Colorizer> colorizer_for(const Subject& subject, const Method& method, int seed) const;
  [[nodiscard]] std::filesystem::path folder_of(const Subject& subject, int seed) const;
  [[nodiscard]] ReportCapture report_of(const Subject& subject) const;
  [[nodiscard]] ComparisonSummary summary() const;

  ComparisonPlan plan_;
  Config config_;
  Reporter& reporter_;
  std::unique_ptr<Lpips> lpips_;
  std::vector<std::shared_ptr<Subject>> subjects_;
  std::vector<ComparisonCell> cells_;
};

}  // namespace cnerf
