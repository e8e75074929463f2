#include "src/pipeline/key_views_step.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iterator>

#include "src/base/files.h"
#include "src/base/json_record.h"
#include "src/picture/contact_sheet.h"
#include "src/picture/encode.h"
#include "src/pipeline/known_color_files.h"
#include "src/pipeline/picture_files.h"
#include "src/train/chroma/key_views.h"
#include "src/train/luminance/luminance_model.h"

namespace cnerf::pipeline {
namespace {

constexpr int kShortSide = 96;    // of views that are looked at: regions, not details
constexpr int kSheetWidth = 320;  // of a photograph on the sheet
constexpr int kSheetColumns = 4;

const View& view_named(const Capture& capture, const std::string& name) {
  return *std::ranges::find(capture.views, name, &View::name);
}

/// Short, since it is cut at the width of a picture.
std::string caption_of(const SuggestedView& one) {
  return fmt::format("{} +{:.0f}%", std::filesystem::path(one.view).stem().string(), 100 * one.adds);
}

}  // namespace

KeyViews suggested_key_views(const RunContext& context, const KeyViewsJob& job, const Engines& engines,
                             Observer& observer) {
  const RunDirectory& directory = context.directory;
  KeyViews result;
  result.take = job.take;
  result.given = key_frame_views(context.capture, context.config.colorizer);
  result.given.insert(result.given.end(), job.given.begin(), job.given.end());
  ViewCache own;
  ViewCache& cache = job.views != nullptr ? *job.views : own;
  if (job.views == nullptr) {
    const LuminanceModel luminance = LuminanceModel::load(directory.stage1_snapshot(), engines);
    cache.fill(luminance.seen(), context.capture, luminance.frame, kShortSide, [&](double fraction) {
      observer.report_progress({"looking at views", fraction, {}});
      if (observer.is_cancelled()) throw Interrupted("stopped; nothing was written");
    });
  }
  const SeenSurfaces seen(cache.views().first(cache.of_capture()), cache.names().first(cache.of_capture()));
  ScenePoints points = scene_points(seen);
  if (!job.take.empty()) {
    const ColorModel take = ColorModel::load(directory.take_snapshot(job.take), engines);
    if (take.pixel_colors == PixelColors::kDistribution) points.doubt = doubts_of(take, seen.views(), points);
  }
  std::vector<std::size_t> given;
  for (const std::string& view : result.given) given.push_back(seen.view_named(view));
  const KeyViewChoice choice = choose_key_views(seen, points, given, std::size_t(job.count));
  const auto named = [&](const KeyView& one) { return SuggestedView{seen.names()[one.view], one.shows, one.adds}; };
  std::ranges::transform(choice.chosen, std::back_inserter(result.suggested), named);
  std::ranges::transform(choice.alone, std::back_inserter(result.alone), named);
  return result;
}

void key_views_step(const RunContext& context, const KeyViewsJob& job, const Engines& engines, Observer& observer) {
  const StepLocks locks(context.directory, context.directory.root(), observer);
  const KeyViews views = suggested_key_views(context, job, engines, observer);
  std::vector<Tile> tiles;
  double told = 0;
  for (const SuggestedView& one : views.suggested) {
    told += one.adds;
    observer.say(fmt::format("{}: shows {:.0f} % of the scene; tells of {:.1f} % more of it, {:.1f} % in all", one.view,
                             100 * one.shows, 100 * one.adds, 100 * told));
    tiles.push_back(
        {scaled_down(grey_picture(view_named(context.capture, one.view).image), kSheetWidth), caption_of(one)});
  }
  const auto sheet = context.directory.root() / "key_views.png", list = context.directory.root() / "key_views.json";
  write_png(sheet, tiled(tiles, kSheetColumns));
  write_file(list, json_of(views).dump(2) + "\n");
  observer.wrote("key views", sheet);
  observer.wrote("their list", list);
}

}  // namespace cnerf::pipeline
