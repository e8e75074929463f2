#include "src/compare/run.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/folder_lock.h"
#include "src/base/json_record.h"
#include "src/cluster/share_out.h"
#include "src/compare/baselines/simulated.h"
#include "src/compare/rating.h"
#include "src/compare/report.h"
#include "src/compare/seed_run.h"

namespace cnerf::compare {
namespace fs = std::filesystem;
namespace {

constexpr int kDeepestCell = 3;  // folders between a seed's and its files

}  // namespace

void begin_report(const fs::path& folder, ExistingReport existing) {
  std::error_code failure;
  if (is_vacant(folder, {"config.toml"})) return;
  if (!fs::is_directory(folder / "runs", failure)) {
    throw UsageError(folder.string() + ": is not empty and holds no comparison; choose another folder");
  }
  if (existing.is_cleared) {
    remove_output(folder / "runs");
  } else if (!existing.is_kept) {
    throw UsageError(folder.string() +
                     ": holds a comparison already; pass --resume to go on with it or --overwrite to start again");
  }
}

Run::Run(Plan plan, Config config, Observer& observer)
    : plan_(std::move(plan)), config_(std::move(config)), observer_(observer), engines_(engines_for(config_.device)) {
  if (!plan_.only_report) encoder_ = make_picture_encoder();
  if (!plan_.lpips_weights.empty()) lpips_ = std::make_unique<Lpips>(plan_.lpips_weights);
  if (config_.colorizer.spec.starts_with(std::string(kSimulated) + ":")) {
    throw UsageError("colorizer \"" + config_.colorizer.spec + "\": simulated takes nothing after it");
  }
  subjects_ = read_subjects(plan_.captures, config_, observer_, plan_.report);
}

void Run::run() {
  const bool is_shared = !cluster::world().is_alone() && !plan_.only_report;
  if (is_shared) make_cells_together();
  for (const auto& subject : subjects_) {
    for (const int seed : plan_.seeds) {
      if (plan_.only_report || is_shared) {
        read_cells(*subject, seed);
      } else {
        std::ranges::move(make_cells(*subject, seed), std::back_inserter(cells_));
      }
    }
  }
  if (cells_.empty()) throw UsageError(plan_.report.string() + ": no finished method of these captures and seeds");
  // A capture without a cell has no table, and the report nothing to show of it.
  std::erase_if(subjects_, [&](const auto& subject) {
    return std::ranges::find(cells_, subject->name, &Cell::capture) == cells_.end();
  });
}

void Run::make_cells_together() {
  const std::size_t seeds = plan_.seeds.size();
  const auto make = [&](std::size_t i) { (void)make_cells(*subjects_[i / seeds], plan_.seeds[i % seeds]); };
  cluster::share_out(cluster::world(), subjects_.size() * seeds, make, [](std::size_t) {});
  cluster::world().barrier("cells of the comparison");
}

fs::path Run::folder_of(const Subject& subject, int seed) const {
  return plan_.report / "runs" / subject.name / fmt::format("seed-{}", seed);
}

std::vector<Cell> Run::make_cells(const Subject& subject, int seed) const {
  const FolderLock lock(folder_of(subject, seed));
  remove_leftovers(folder_of(subject, seed), kDeepestCell);
  const Bench bench{plan_, config_, engines_, lpips_.get(), encoder_.get(), observer_};
  SeedRun seed_run(bench, subject, seed, folder_of(subject, seed));
  seed_run.train();
  std::vector<Cell> cells;
  for (const Method* method : plan_.methods) cells.push_back(seed_run.make(*method));
  return cells;
}

void Run::read_cells(const Subject& subject, int seed) {
  for (const Method* method : plan_.methods) {
    const fs::path file = folder_of(subject, seed) / method->name / "cell.json";
    if (fs::exists(file)) cells_.push_back(read_record<Cell>(file));
  }
}

void Run::write_report() const {
  std::vector<ReportCapture> captures;
  for (const auto& subject : subjects_) {
    const fs::path cells = folder_of(*subject, plan_.seeds.front());
    const fs::path strip = plan_.report / ("strip-" + subject->name + ".png");
    write_strip(*subject, plan_.methods, cells, strip);
    observer_.wrote("pictures", strip);
    captures.push_back(exhibit(*subject, plan_.methods, config_.stage2, cells));
  }
  const Summary summary{config_.colorizer.spec, lpips_ ? lpips_->network() : "", plan_.command_line};
  write_file(plan_.report / "table.json", table_json(cells_, summary).dump(2) + "\n");
  write_file(plan_.report / "table.md", table_markdown(cells_, summary));
  write_file(plan_.report / "report.html", report_html(cells_, summary, captures));
  for (const char* file : {"table.json", "table.md", "report.html"}) observer_.wrote("comparison", plan_.report / file);
}

void Run::write_rating_sheet() const {
  std::vector<RatedPicture> pictures;
  for (const auto& subject : subjects_) {
    const ReportCapture shown =
        exhibit(*subject, plan_.methods, config_.stage2, folder_of(*subject, plan_.seeds.front()));
    for (const ReportMethod& method : shown.methods) {
      const bool is_bound = method.name == "grey" || method.name == "oracle";
      for (std::size_t v = 0; v < method.views.size() && !is_bound; ++v) {
        pictures.push_back({subject->name, shown.views[v], method.name, method.views[v]});
      }
    }
  }
  const RatingSheet sheet = make_rating_sheet(std::move(pictures), std::uint64_t(plan_.seeds.front()));
  write_file(plan_.report / "rating_sheet.html", sheet.html);
  write_file(plan_.report / "rating_key.json", sheet.key);
  observer_.wrote("rating sheet, for raters", plan_.report / "rating_sheet.html");
  observer_.wrote("its key, not for raters", plan_.report / "rating_key.json");
}

}  // namespace cnerf::compare
