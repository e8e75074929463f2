#pragma once
/// Runs a comparison: stage 1 once per capture and seed, every method on top of it, and a report of what is there.
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
#include "src/compare/cell.h"
#include "src/compare/methods.h"
#include "src/compare/seed_run.h"
#include "src/compare/subject.h"
#include "src/engine/engines.h"
#include "src/evaluate/lpips.h"

namespace cnerf::compare {

/// A comparison that is there already is gone on with, or made anew, only when that is asked for.
struct ExistingReport {
  bool is_kept = false, is_cleared = false;
};
/// @throws UsageError  a folder of something else, or a comparison without either choice
void begin_report(const std::filesystem::path& folder, ExistingReport existing);

class Run {
 public:
  /// Reads the captures, so that what is missing costs no training.
  /// @throws UsageError, MissingInputError, InputError  also for a capture without any colour.
  Run(Plan plan, Config config, Observer& observer);
  Run(const Run&) = delete;
  Run& operator=(const Run&) = delete;

  /// All cells, shared by the ranks; a method that fails leaves one that says why.
  /// @throws Interrupted  what is finished stays.
  void run();
  /// Writes the tables and the report, of the captures that have a cell.
  void write_report() const;
  /// Writes the rating sheet and its key, likewise.
  void write_rating_sheet() const;

 private:
  void make_cells_together();
  void make_colors(const Subject& subject, int seed, bool are_judged);
  void judge_cell(const Subject& subject, int seed, const Method& method);
  void read_cells(const Subject& subject, int seed);
  [[nodiscard]] std::filesystem::path folder_of(const Subject& subject, int seed) const;

  Plan plan_;
  Config config_;
  Observer& observer_;
  const Engines& engines_;
  std::unique_ptr<Lpips> lpips_;
  std::unique_ptr<PictureEncoder> encoder_;
  Bench bench_;
  std::vector<std::unique_ptr<const Subject>> subjects_;
  std::vector<Cell> cells_;
};

}  // namespace cnerf::compare
