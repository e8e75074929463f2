#include "src/train/chroma/session.h"

#include <algorithm>
#include <cmath>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/picture/picture.h"
#include "src/train/luminance/options_json.h"
#include "src/train/luminance/shared_steps.h"

namespace cnerf {
namespace {

constexpr std::size_t kPreviews = 3;
constexpr int kPreviewSide = 120;       // pixels of the shorter side
constexpr double kPreviewShare = 0.95;  // of a pixel's weight

}  // namespace

Session::Session(const Stage2Job& job, Observer& observer)
    : options(job.options),
      colorizer(job.colorizer),
      job_(job),
      observer_(observer),
      cache_(job.views != nullptr ? *job.views : own_cache_) {}

void Session::start_or_resume(const Engines& engines, PixelColors pixel_colors) {
  begin_model(engines, pixel_colors);
  model.chroma->share_steps(share_of(ranks()));
  model.chromaticity->share_steps(share_of(ranks()));
}

void Session::begin_model(const Engines& engines, PixelColors pixel_colors) {
  const std::string digest = sha256_of_file(job_.stage1),
                    source = colorizer.name() + describe(job_.known) + describe_viewpoints(job_.viewpoints);
  const std::filesystem::path& file = job_.take;
  if (!job_.resume || !std::filesystem::exists(file)) {
    model = ColorModel::create(options, engines);
    model.colorizer = source;
    model.stage1_sha256 = digest;
    model.pixel_colors = pixel_colors;
    return;
  }
  model = ColorModel::load(file, engines);
  if (model.stage1_sha256 != digest) {
    throw SnapshotError(file.string() + ": colorizes another stage 1 snapshot; run without --resume");
  }
  if (model.colorizer != source || model.pixel_colors != pixel_colors ||
      options_to_json(model.options) != options_to_json(options)) {
    throw SnapshotError(
        file.string() +
        ": was made with another colorizer or other stage2 options; run with the same ones, or begin this "
        "take again: cnerf colorize --take NAME --overwrite");
  }
  say_kernels(file, model.kernels_before, model.kernels, observer_);
  seconds_before_ = model.report.seconds;
}

void Session::cache_views(const Engines& engines) {
  const LuminanceModel luminance = LuminanceModel::load(job_.stage1, engines);
  if (luminance.sky.exists() && !model.sky.exists()) model.sky = SkyColors::grey();
  if (observer_.wants_previews() && model.chroma) cache_previews(luminance);
  const auto told = [this](double fraction) { report("stage 2: caching views", fraction); };
  // A GPU traces all views in half the time that they take to be handed round.
  if (ranks().any(engines.device() == Device::kCpu)) cache_.trace_with(ranks());
  cache_.fill(luminance.seen(), job_.capture, luminance.frame, options.working_resolution, told);
  cache_.add(cache_.traced(luminance.seen(), luminance.frame, job_.viewpoints, told));
  cache_.put_first(job_.viewpoints);
  const std::size_t count = cache_.of_capture() + job_.viewpoints.size();
  views_ = cache_.views().first(count);
  names_ = cache_.names().first(count);
}

void Session::cache_previews(const LuminanceModel& luminance) {
  for (const View& view : job_.capture.views) {
    if (!view.held_out || previews_.size() >= kPreviews) continue;
    const UnitCamera camera(view.intrinsics, view.world_from_camera, luminance.frame);
    previews_.push_back({view.name, cache_view(luminance.seen(), camera, kPreviewSide, kPreviewShare)});
  }
}

PreviewPicture Session::preview(std::size_t index) const {
  const auto& [name, view] = previews_[index % previews_.size()];
  PreviewPicture picture{name, view.width, view.height, {}, view.luminance};
  std::vector<ViewPixel> all(view.luminance.size());
  for (std::size_t p = 0; p < all.size(); ++p) all[p].pixel = std::uint32_t(p);
  const PixelSamples samples = pixel_samples(std::span(&view, 1), all);
  const std::vector<Ab> colors = model.decode(samples);
  const std::vector<float> field = pixel_luminance(samples);
  for (std::size_t p = 0; p < all.size(); ++p) {
    Ab ab = view.opacity[p] < kLeastColoredOpacity ? Ab{} : colors[p];
    if (model.sky.exists()) ab = model.sky.behind(view, p, field[p], ab);
    const Vec3f rgb = linear_rgb_at(view.luminance[p], ab);
    picture.ours.insert(picture.ours.end(), {rgb.x, rgb.y, rgb.z});
  }
  return picture;
}

void Session::tell(const std::string& task, double fraction, Figures figures) {
  clock_.pause_for([&] {
    observer_.report_progress({task, std::min(fraction, 1.0), std::move(figures)});
    if (!previews_.empty()) observer_.offer_preview([this](std::size_t index) { return preview(index); });
    if (job_.watch && model.chroma) job_.watch(model);
  });
}

void Session::report(const std::string& task, double fraction, Figures figures) {
  tell(task, fraction, std::move(figures));
  if (!observer_.is_cancelled()) return;
  if (!model.chroma || !ranks().is_alone()) throw Interrupted("stopped; nothing was written");
  save();
  throw Interrupted("stopped; saved " + job_.take.string() + ", continue with --resume");
}

void Session::after_step(const std::string& task, const std::string& loss_name, long done, int all) {
  if (!std::isfinite(loss)) {
    throw DivergedError(task + ": the " + loss_name + " is not finite after " + std::to_string(done) + " of " +
                        std::to_string(all) + " steps; what was saved last is kept");
  }
  const Stage2Report& so_far = model.report;
  const int asked = so_far.accepted + so_far.rejected;
  tell(task, double(done) / all,
       {{loss_name, loss},
        {"accepted", double(so_far.accepted) / std::max(asked, 1)},
        {"waited s", so_far.waited_seconds}});
  if (!ranks().any(observer_.is_cancelled())) return;
  save();
  throw Interrupted("stopped; saved " + job_.take.string() + ", continue with --resume");
}

void Session::save() {
  model.report.seconds = seconds_before_ + clock_.seconds();
  if (ranks().is_first()) model.save(job_.take);
  ranks().barrier("snapshot of stage 2");
}

}  // namespace cnerf
