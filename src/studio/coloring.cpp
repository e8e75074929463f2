#include "src/studio/coloring.h"

#include <algorithm>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/pipeline/run_directory.h"
#include "src/train/chroma/stage2.h"

namespace cnerf::studio {
namespace fs = std::filesystem;

std::vector<KnownColors> known_of(const std::vector<Stroke>& strokes, std::span<const CachedView> views,
                                  std::span<const std::string> names) {
  std::vector<Intrinsics> lenses;
  for (const CachedView& view : views) lenses.push_back(view.camera.intrinsics);
  return painted(strokes, names, lenses);
}

Journal read_journal(const fs::path& file, std::span<const std::string> views) {
  PaintedPictures pictures(file.parent_path());
  auto journal = read_record<Journal>(file);
  if (journal.deeds.empty()) throw InputError(file, "deeds", "expected at least one");
  if (const std::string& base = journal.deeds.front().base; !base.empty()) pipeline::check_take_name(base);
  for (std::size_t i = 0; i < journal.deeds.size(); ++i) {
    StrokeList list{0, std::move(journal.deeds[i].strokes)};
    const fs::path of_deed = file.string() + ": deeds[" + std::to_string(i) + "]";
    journal.deeds[i].strokes = strokes_of_json(json_of(list).dump(), of_deed, views, pictures).strokes;
  }
  return journal;
}

Coloring::Coloring(const pipeline::RunContext& context, const Engines& engines)
    : context_(context),
      engines_(engines),
      luminance_(LuminanceModel::load(context.directory.stage1_snapshot(), engines)),
      stage1_sha256_(sha256_of_file(context.directory.stage1_snapshot())) {
  begin("");
}

void Coloring::cache_views(const Breathe& breathe) {
  if (seen_) return;
  cache_.fill(*luminance_.engine, luminance_.march(), context_.capture, luminance_.frame,
              context_.config.stage2.working_resolution, breathe);
  seen_.emplace(cache_.views(), cache_.names());
}

void Coloring::begin(const std::string& take) {
  std::unique_ptr<ColorModel> base;
  if (!take.empty()) {
    base = std::make_unique<ColorModel>(ColorModel::load(context_.directory.take_snapshot(take), engines_));
  }
  auto now =
      std::make_unique<ColorModel>(base ? base->copy(engines_) : ColorModel::create(context_.config.stage2, engines_));
  now->stage1_sha256 = stage1_sha256_;
  base_ = std::move(base);
  now_ = std::move(now);
  base_name_ = kept_as_ = take;
  is_grey_ = take.empty();
  is_unkept_ = false;
  journal_.deeds = {{take, {}, 0}};
}

void Coloring::take_is_called(const std::string& take, const std::string& name) {
  if (base_name_ == take) base_name_ = journal_.deeds.front().base = name;
  if (kept_as_ != take) return;
  kept_as_ = name;
  is_unkept_ = is_unkept_ || name.empty();
}

void Coloring::colour(const std::vector<Stroke>& strokes, const RetouchOptions& options, const Breathe& breathe,
                      int most_steps) {
  cache_views([&](double fraction) { breathe(fraction * 0.2); });
  const std::vector<KnownColors> known = known_of(strokes, cache_.views(), cache_.names());
  const KnownColorMap map(*seen_, KnownColorSources(*seen_, known));
  Retouch retouch(cache_.views(), map, base_.get(), *now_, options);
  is_grey_ = false;
  is_unkept_ = true;
  kept_as_.clear();
  now_->colorizer = (base_ ? base_->colorizer : std::string(pipeline::kGreyTake)) + describe(known);
  journal_.deeds.push_back({"", strokes, 0});
  while (!retouch.is_settled() && retouch.steps_done() < most_steps) {
    retouch.step();
    journal_.deeds.back().steps = retouch.steps_done();
    breathe(double(retouch.steps_done()) / options.steps);
  }
}

void Coloring::keep(const std::string& take, double seconds, Observer& observer) {
  if (is_grey_) throw UsageError("nothing is coloured yet, so there is nothing to keep");
  const pipeline::RunDirectory& directory = context_.directory;
  const fs::path folder = directory.take_folder(take);
  const FolderLock lock = pipeline::lock_folder(folder, FolderLock::Mode::kAlone, observer);
  if (directory.take_record(take)) throw UsageError("a take of this name exists: " + take);
  write_file(directory.take_config_file(take), to_toml(context_.config));
  now_->report.seconds += seconds;
  now_->save(directory.take_snapshot(take));
  write_file(folder / kJournalFile, json_of(journal_).dump() + "\n");
  directory.save(pipeline::TakeRecord{take, now_->colorizer, now_->report});
  directory.update([&](pipeline::RunRecord& record) { record.current_take = take; });
  kept_as_ = take;
  is_unkept_ = false;
}

void Coloring::replay(const Journal& journal, const RetouchOptions& options, const Breathe& breathe) {
  begin(journal.deeds.front().base);
  const auto count = double(journal.deeds.size() - 1);
  for (std::size_t i = 1; i < journal.deeds.size(); ++i) {
    const Deed& deed = journal.deeds[i];
    colour(
        deed.strokes, options, [&](double fraction) { breathe((double(i - 1) + fraction) / count); }, deed.steps);
  }
}

}  // namespace cnerf::studio
