#include "src/compare/run.h"

#include <fmt/format.h>

#include <algorithm>

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
    : plan_(std::move(plan)),
      config_(std::move(config)),
      observer_(observer),
      engines_(engines_for(config_.device)),
      lpips_(plan_.lpips_weights.empty() ? nullptr : std::make_unique<Lpips>(plan_.lpips_weights)),
      encoder_(plan_.only_report ? nullptr : make_picture_encoder()),
      bench_{plan_, config_, engines_, lpips_.get(), encoder_.get(), observer_} {
  if (config_.colorizer.spec.starts_with(std::string(kSimulated) + ":")) {
    throw UsageError("colorizer \"" + config_.colorizer.spec + "\": simulated takes nothing after it");
  }
  subjects_ = read_subjects(plan_.captures, config_, observer_, plan_.report);
}

void Run::run() {
  const bool is_alone = cluster::world().is_alone(), trains = !plan_.only_report;
  if (trains && !is_alone) make_cells_together();
  for (const auto& subject : subjects_) {
    for (const int seed : plan_.seeds) {
      if (trains && is_alone) make_colors(*subject, seed, /*are_judged=*/true);
      read_cells(*subject, seed);
    }
  }
  if (cells_.empty()) throw UsageError(plan_.report.string() + ": no finished method of these captures and seeds");
  // A capture without a cell has no table, and the report nothing to show of it.
  std::erase_if(subjects_, [&](const auto& subject) {
    return std::ranges::find(cells_, subject->name, &Cell::capture) == cells_.end();
  });
}

/// Pieces are the trainings of all captures and seeds, then the judging of each cell. Those are short, so that all
/// ranks are busy to the end.
void Run::make_cells_together() {
  cluster::Ranks& ranks = cluster::world();
  const std::size_t seeds = plan_.seeds.size(), methods = plan_.methods.size(), trainings = subjects_.size() * seeds;
  const std::int64_t trained = ranks.begin_work();
  const auto make = [&](std::size_t piece) {
    const bool is_training = piece < trainings;
    const std::size_t training = is_training ? piece : (piece - trainings) / methods;
    const Subject& subject = *subjects_[training / seeds];
    const int seed = plan_.seeds[training % seeds];
    if (is_training) {
      make_colors(subject, seed, /*are_judged=*/false);
      ranks.announce(trained, std::int64_t(training));
    } else {
      ranks.await(trained, std::int64_t(training));
      judge_cell(subject, seed, *plan_.methods[(piece - trainings) % methods]);
    }
  };
  cluster::share_out(ranks, trainings * (1 + methods), make, [](std::size_t) {});
  ranks.barrier("cells of the comparison");
}

fs::path Run::folder_of(const Subject& subject, int seed) const {
  return plan_.report / "runs" / subject.name / fmt::format("seed-{}", seed);
}

/// Stage 1 of a capture with a seed, and the colours of all methods; what is there stays.
/// @param are_judged  each at once, so that a comparison which is stopped has finished cells
void Run::make_colors(const Subject& subject, int seed, bool are_judged) {
  const fs::path folder = folder_of(subject, seed);
  const FolderLock lock(folder);
  remove_leftovers(folder, kDeepestCell);
  SeedRun seed_run(bench_, subject, seed, folder);
  seed_run.train();
  for (const Method* method : plan_.methods) {
    seed_run.color(*method);
    if (are_judged) (void)seed_run.judge(*method);
  }
}

void Run::judge_cell(const Subject& subject, int seed, const Method& method) {
  const fs::path folder = folder_of(subject, seed);
  const FolderLock shared(folder, FolderLock::Mode::kShared), own(folder / method.name);
  (void)SeedRun(bench_, subject, seed, folder).judge(method);
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
