#pragma once
/// Runs a comparison: stage 1 once a capture and seed, every method on top of it, and a report of what is there.
///
///   REPORT/table.json, table.md, report.html, strip-CAPTURE.png
///   REPORT/rating_sheet.html, rating_key.json      with --rating-sheet
///   REPORT/runs/CAPTURE/seed-N/stage1.snapshot
///   REPORT/runs/CAPTURE/seed-N/METHOD/             take.snapshot, cell.json, galleries, views/, turntable/
///
/// A cell whose settings are unchanged and that did not fail is not made again: stopping and going on is one command.

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "src/base/observer.h"
#include "src/capture/capture.h"
#include "src/compare/baselines/style_transfer.h"
#include "src/compare/methods.h"
#include "src/compare/options.h"
#include "src/compare/report.h"
#include "src/evaluate/lpips.h"

namespace cnerf::compare {

/// A capture to compare on.
struct ComparedCapture {
  std::filesystem::path path;
  int downscale = 0;  ///< divides image sizes; 0 = as capture.downscale says
};
/// "fox@4": the folder and what its image sizes are divided by; without "@", as configured.
/// @throws UsageError
[[nodiscard]] ComparedCapture parse_compared_capture(const std::string& text);

struct Plan {
  std::vector<ComparedCapture> captures;
  std::filesystem::path report;  ///< folder
  std::vector<const Method*> methods;
  std::vector<int> seeds;
  std::filesystem::path lpips_weights;  ///< empty = LPIPS is not measured
  std::string command_line;
  bool only_report = false;  ///< nothing is trained: the report is made of the cells that are there
};

class Run {
 public:
  /// Reads the captures, so that what is missing costs no training.
  /// @throws UsageError, MissingInputError, InputError  also for a capture without any colour.
  Run(Plan plan, CompareConfig config, Observer& observer);

  /// All cells; a method that fails leaves one that says why.  @throws Interrupted  what is finished stays.
  void run();
  /// Writes the tables and the report.
  void write_report() const;
  /// Writes the rating sheet and its key.
  void write_rating_sheet() const;

 private:
  struct Subject;   ///< a capture and its name
  struct Geometry;  ///< what all methods share that stand on one stage 1
  struct Field;     ///< what a method's colours stand on

  void run_capture(const Subject& subject, int seed);
  void collect(const Subject& subject, int seed);
  [[nodiscard]] std::string train(const Subject& subject, int seed, const std::filesystem::path& folder) const;
  void train_own_field(const Subject& subject, int seed, const Geometry& geometry, const Engines& engines,
                       Cell& cell) const;
  [[nodiscard]] Cell run_cell(const Subject& subject, const Method& method, int seed, Geometry& geometry,
                              const std::string& settings) const;
  [[nodiscard]] StyleReport transfer(const Subject& subject, const std::filesystem::path& stage1,
                                     const Stage2Options& options, Colorizer& colorizer,
                                     const std::filesystem::path& take) const;
  [[nodiscard]] Field field_of(const Subject& subject, const Method& method, const Geometry& geometry) const;
  void colorize(const Subject& subject, const Method& method, int seed, Geometry& geometry, Cell& cell) const;
  void look(const Subject& subject, const Method& method, Geometry& geometry, Cell& cell) const;
  [[nodiscard]] std::unique_ptr<Colorizer> colorizer_for(const Subject& subject, const Method& method, int seed) const;
  [[nodiscard]] std::filesystem::path folder_of(const Subject& subject, int seed) const;
  [[nodiscard]] std::filesystem::path write_strip(const Subject& subject) const;
  [[nodiscard]] ReportCapture report_of(const Subject& subject) const;
  [[nodiscard]] Summary summary() const;

  Plan plan_;
  CompareConfig config_;
  Observer& observer_;
  const Engines& engines_;
  std::unique_ptr<Lpips> lpips_;
  std::vector<std::shared_ptr<Subject>> subjects_;
  std::vector<Cell> cells_;
};

}  // namespace cnerf::compare
