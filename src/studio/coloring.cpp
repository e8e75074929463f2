#include "src/studio/coloring.h"

#include <algorithm>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/pipeline/run_directory.h"
#include "src/studio/paint_files.h"
#include "src/train/chroma/stage2.h"

namespace cnerf::studio {
namespace fs = std::filesystem;

Journal read_journal(const fs::path& file, const PaintableViews& views) {
  PaintedPictures pictures(file.parent_path());
  auto journal = read_record<Journal>(file);
  journal.folder = file.parent_path();
  if (journal.deeds.empty()) throw InputError(file, "deeds", "expected at least one");
  if (const std::string& base = journal.deeds.front().base; !base.empty()) pipeline::check_take_name(base);
  for (std::size_t i = 0; i < journal.deeds.size(); ++i) {
    Deed& deed = journal.deeds[i];
    const StrokeList list{0, std::move(deed.strokes), deed.viewpoints, deed.everywhere};
    const fs::path of_deed = file.string() + ": deeds[" + std::to_string(i) + "]";
    deed.strokes = strokes_of_json(json_of(list).dump(), of_deed, views, pictures).strokes;
  }
  return journal;
}

void write_journal(const fs::path& file, const Journal& journal) {
  write_file(file, json_of(journal).dump() + "\n");
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
  cache_.fill(luminance_.seen(), context_.capture, luminance_.frame, context_.config.stage2.working_resolution,
              breathe);
  seen_.emplace(cache_.views(), cache_.names());
}

/// What the capture's views see stays as it is.
void Coloring::change_seen(const std::function<void()>& change) {
  const std::unique_lock lock(seen_mutex_);
  known_.reset();
  change();
  seen_ = SeenSurfaces(cache_.views(), cache_.names(), seen_->surfaces().first(cache_.of_capture()));
}

void Coloring::see(std::span<const Viewpoint> viewpoints, const Breathe& breathe) {
  // `breathe` may come back here, so that another call is through first; what is there twice then is left out.
  auto traced = cache_.traced(luminance_.seen(), luminance_.frame, viewpoints, breathe);
  if (!traced.empty()) change_seen([&] { cache_.add(std::move(traced)); });
}

void Coloring::forget_others(std::span<const Viewpoint> viewpoints) {
  const auto is_other = [&](const Viewpoint& one) { return std::ranges::find(viewpoints, one) == viewpoints.end(); };
  if (std::ranges::any_of(cache_.viewpoints(), is_other)) change_seen([&] { cache_.keep_only(viewpoints); });
}

std::shared_ptr<const KnownStrokes> Coloring::known(const StrokeList& list) const {
  const std::lock_guard lock(known_mutex_);
  if (!known_ || !known_->is_of(list)) known_ = std::make_shared<const KnownStrokes>(list, *seen_);
  return known_;
}

bool Coloring::has_seen(std::span<const Viewpoint> viewpoints) const {
  return std::ranges::all_of(viewpoints, [this](const Viewpoint& viewpoint) { return cache_.holds(viewpoint); });
}

void Coloring::begin(const std::string& take) {
  std::unique_ptr<ColorModel> base;
  Deed first{take, {}, 0};
  if (!take.empty()) {
    const fs::path snapshot = context_.directory.take_snapshot(take);
    base = std::make_unique<ColorModel>(ColorModel::load(snapshot, engines_));
    first.base_sha256 = sha256_of_file(snapshot);
  }
  auto now =
      std::make_unique<ColorModel>(base ? base->copy(engines_) : ColorModel::create(context_.config.stage2, engines_));
  now->stage1_sha256 = stage1_sha256_;
  if (luminance_.sky.exists() && !now->sky.exists()) now->sky = SkyColors::grey();
  base_ = std::move(base);
  now_ = std::move(now);
  base_name_ = kept_as_ = take;
  is_grey_ = take.empty();
  is_unkept_ = false;
  journal_ = {{first}, stroke_folder(context_)};
}

void Coloring::take_is_called(const std::string& take, const std::string& name) {
  if (base_name_ == take) base_name_ = journal_.deeds.front().base = name;
  if (kept_as_ != take) return;
  kept_as_ = name;
  is_unkept_ = is_unkept_ || name.empty();
}

void Coloring::colour(const StrokeList& list, const RetouchOptions& options, const Breathe& breathe, int most_steps) {
  const auto told = [&](double fraction) { breathe(fraction * 0.2); };
  const std::vector<Viewpoint> viewpoints = painted_viewpoints(list);
  cache_views(told);
  forget_others(list.viewpoints);
  see(viewpoints, told);
  if (!has_seen(viewpoints)) throw UsageError("viewpoints came and went too fast; once more, please");
  if (!viewpoints.empty()) change_seen([&] { cache_.put_first(viewpoints); });
  // What comes later, for others to look at, has no part in this: it repeats bit for bit.
  const std::size_t views = cache_.of_capture() + viewpoints.size();
  const auto strokes = known(list);
  const KnownColorMap map = strokes->map(views);
  Retouch retouch(seen_->views().first(views), map, base_.get(), *now_, options);
  is_grey_ = false;
  is_unkept_ = true;
  kept_as_.clear();
  now_->colorizer = (base_ ? base_->colorizer : std::string(pipeline::kGreyTake)) + describe(strokes->painted()) +
                    describe_viewpoints(viewpoints);
  journal_.deeds.push_back({"", list.strokes, 0, viewpoints, list.everywhere});
  while (!retouch.is_settled() && retouch.steps_done() < most_steps) {
    retouch.step();
    journal_.deeds.back().steps = retouch.steps_done();
    breathe(double(retouch.steps_done()) / options.steps);
  }
}

void Coloring::keep(const std::string& take, double seconds, Observer& observer, bool overwrite) {
  if (is_grey_) throw UsageError("nothing is coloured yet, so there is nothing to keep");
  const pipeline::RunDirectory& directory = context_.directory;
  const fs::path folder = directory.take_folder(take);
  const FolderLock lock = pipeline::lock_folder(folder, FolderLock::Mode::kAlone, observer);
  if (directory.take_record(take) && !overwrite) throw UsageError("a take of this name exists: " + take);
  if (overwrite) clear_folder(folder);
  write_file(directory.take_config_file(take), to_toml(context_.config));
  now_->report.seconds += seconds;
  now_->save(directory.take_snapshot(take));
  const PaintedPictures from(journal_.folder), to(folder);
  for (const Deed& deed : journal_.deeds) copy_pictures(deed.strokes, from, to);
  write_journal(folder / kJournalFile, journal_);
  directory.save(pipeline::TakeRecord{take, now_->colorizer, now_->report});
  directory.update([&](pipeline::RunRecord& record) { record.current_take = take; });
  kept_as_ = take;
  is_unkept_ = false;
}

void Coloring::replay(const Journal& journal, const RetouchOptions& options, const Breathe& breathe) {
  const Deed& first = journal.deeds.front();
  const fs::path base = context_.directory.take_snapshot(first.base);
  if (!first.base_sha256.empty() && fs::exists(base) && sha256_of_file(base) != first.base_sha256) {
    throw SnapshotError(base.string() + ": is another take than the one of that name that the journal begins from");
  }
  begin(first.base);
  journal_.folder = journal.folder;
  const auto count = double(journal.deeds.size() - 1);
  for (std::size_t i = 1; i < journal.deeds.size(); ++i) {
    const Deed& deed = journal.deeds[i];
    colour(
        {0, deed.strokes, deed.viewpoints, deed.everywhere}, options,
        [&](double fraction) { breathe((double(i - 1) + fraction) / count); }, deed.steps);
  }
}

}  // namespace cnerf::studio
