#include "src/pipeline/evaluate_step.h"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>
#include <optional>

#include "src/base/files.h"
#include "src/base/json_record.h"
#include "src/base/usage.h"
#include "src/cluster/packing.h"
#include "src/cluster/share_out.h"
#include "src/evaluate/evaluate.h"
#include "src/evaluate/held_out_camera.h"
#include "src/picture/contact_sheet.h"
#include "src/picture/curve_picture.h"
#include "src/picture/encode.h"
#include "src/pipeline/render_step.h"

namespace cnerf::pipeline {
namespace {

constexpr int kSheetRows = 6;

void say_metrics(const Metrics& metrics, Observer& observer) {
  const ViewMetrics& mean = metrics.mean;
  std::string text = fmt::format("{} views ({}): luminance {:.2f} dB", metrics.views.size(), metrics.split,
                                 mean.psnr_luminance.value_or(0));
  if (const auto found = metrics.spread.find("psnr_luminance"); found != metrics.spread.end()) {
    text += fmt::format(" (worst {:.2f})", found->second.worst);
  }
  if (mean.psnr_luminance_exposure_fitted) {
    text += fmt::format(", exposure fitted {:.2f} dB", *mean.psnr_luminance_exposure_fitted);
  }
  if (mean.psnr_luminance_aligned) {
    text += fmt::format(", right halves aligned {:.2f} dB", *mean.psnr_luminance_aligned);
  }
  if (mean.near_opacity) text += fmt::format(", fog before cameras {:.2f} %", 100 * *mean.near_opacity);
  if (mean.ssim) text += fmt::format(", SSIM {:.3f}", *mean.ssim);
  if (mean.psnr_rgb) text += fmt::format(", RGB {:.2f} dB", *mean.psnr_rgb);
  if (mean.lpips) text += fmt::format(", LPIPS {:.3f}", *mean.lpips);
  if (mean.ab_error) text += fmt::format(", ab error {:.2f} (all grey {:.2f})", *mean.ab_error, *mean.ab_error_grey);
  if (mean.bake_ab_distance) text += fmt::format(", baked colour {:.2f} ab from per-pixel", *mean.bake_ab_distance);
  if (metrics.feature_distance) text += fmt::format(", features {:.1f} apart", *metrics.feature_distance);
  observer.say(text);
}

/// A view's row of the contact sheet.
using SheetRow = std::vector<Picture>;

SheetRow row_of(const EvaluatedView& view) {
  const Picture truth =
      view.truth ? picture_from_linear(view.truth->width, view.truth->height, view.truth->rgb) : Picture{};
  return {grey_picture(view.view.image), picture_of(view.ours, ShownColor::kDecoded), truth};
}

/// What training found out about its views, below the table: exposures, how far cameras moved, the sky.
void add_estimates(const LearnedViews& learned, const Scene& scene, ContactSheet& sheet) {
  constexpr int kWidth = 400, kHeight = 130;
  std::vector<double> gains, degrees;
  for (const ViewCorrection& correction : learned.corrections) {
    gains.push_back(correction.gain());
    degrees.push_back(double(length(correction.turn)) * 180 / std::numbers::pi);
  }
  const auto add_curve = [&](const std::string& title, const std::vector<double>& values, std::optional<double> level) {
    if (values.empty()) return;
    const auto [least, most] = std::ranges::minmax(values);
    if (!(least < most)) return;
    sheet.add_below(
        {curve_picture(values, level, kWidth, kHeight), fmt::format("{} {:.2f} to {:.2f}", title, least, most)});
  };
  add_curve("exposures:", gains, 1);
  add_curve("cameras turned, degrees:", degrees, {});
  if (const auto sky = scene.sky()) {
    sheet.add_below({scaled_down(picture_from_linear(sky->width, sky->height, sky->rgb), kWidth), "sky, all around"});
  }
}

/// What a rank finds out about a view.
struct SeenView {
  ViewMetrics metrics;
  SheetRow row;  ///< of the first views
};

cluster::Bytes packed(const SeenView& seen) {
  cluster::Packer packer;
  packer.add(seen.metrics.view).add(seen.metrics.features_ours).add(seen.metrics.features_truth);
  ViewMetrics::visit_numbers(seen.metrics, [&](const char*, const auto& value) { packer.add(value); });
  packer.add(seen.row.size());
  for (const Picture& picture : seen.row) packer.add(picture.width).add(picture.height).add(picture.rgb);
  return packer.packed();
}

SeenView unpacked(const cluster::Bytes& bytes) {
  SeenView seen;
  cluster::Unpacker unpacker(bytes);
  std::size_t pictures = 0;
  unpacker.get(seen.metrics.view).get(seen.metrics.features_ours).get(seen.metrics.features_truth);
  ViewMetrics::visit_numbers(seen.metrics, [&](const char*, auto& value) { unpacker.get(value); });
  unpacker.get(pictures);
  seen.row.resize(pictures);
  for (Picture& picture : seen.row) unpacker.get(picture.width).get(picture.height).get(picture.rgb);
  return seen;
}

/// `evaluate` by all ranks, a view at a time; the result is rank 0's.
Metrics evaluate_together(const Scene& scene, const Capture& capture, const EvaluateOptions& options,
                          ContactSheet& sheet, const ProgressSink& progress) {
  const std::vector<const View*> views = views_to_evaluate(capture, options);
  Metrics metrics;
  metrics.split = split_of(views);
  const auto see = [&](std::size_t i) {
    SeenView seen;
    const auto keep_row = [&](const EvaluatedView& view) {
      if (i < std::size_t(kSheetRows)) seen.row = row_of(view);
    };
    seen.metrics = evaluate_views(scene, std::span(views).subspan(i, 1), options, keep_row).front();
    return seen;
  };
  const auto take = [&](std::size_t, const SeenView& seen) {
    metrics.views.push_back(seen.metrics);
    if (!seen.row.empty()) sheet.add_row(seen.row);
    progress(progress_of(metrics, views.size()));
  };
  cluster::share_out(cluster::world(), views.size(), see, take, packed, unpacked);
  summarise(metrics);
  return metrics;
}

}  // namespace

void evaluate_step(const RunContext& context, const EvaluateJob& job, const Engines& engines, Observer& observer) {
  const RunDirectory& directory = context.directory;
  const StepLocks locks(directory, job.take.empty() ? directory.root() : directory.take_folder(job.take), observer);
  const Stopwatch watch;
  std::optional<Lpips> lpips;
  if (!job.lpips_weights.empty()) lpips.emplace(job.lpips_weights);  // read first: what is missing costs no rendering
  const StepScene scene(job.scene, directory, job.take, {}, engines);
  EvaluateOptions options;
  options.lpips = lpips ? &*lpips : nullptr;
  const auto encoder = job.take.empty() ? nullptr : make_picture_encoder();
  options.encoder = encoder.get();
  options.render = render_options(context.config);
  const LearnedViews learned = LuminanceModel::learned_views_in(directory.stage1_snapshot());
  options.alignment = alignment_of(context.capture, learned);
  if (job.aligned && !options.alignment) options.alignment = PoseAlignment();
  ContactSheet sheet({"input", "ours", "truth"});
  const auto add_to_sheet = [&](const EvaluatedView& view) {
    if (sheet.rows() < kSheetRows) sheet.add_row(row_of(view));
  };
  const ProgressSink progress = observer.progress_sink();
  Metrics metrics = cluster::world().is_alone() ? evaluate(*scene, context.capture, options, add_to_sheet, progress)
                                                : evaluate_together(*scene, context.capture, options, sheet, progress);
  if (!cluster::world().is_first()) return;
  metrics.take = job.take;
  metrics.colorizer = colorizer_name(directory, job.take);

  add_estimates(learned, *scene, sheet);

  write_png(directory.contact_sheet(), sheet.compose());
  const std::string json = json_of(metrics).dump(2) + "\n";
  if (!job.take.empty()) write_file(directory.take_folder(job.take) / "metrics.json", json);
  write_file(directory.metrics_file(), json);  // last: where it is, `cnerf run --resume` does not evaluate
  say_metrics(metrics, observer);
  observer.wrote("metrics", directory.metrics_file());
  observer.wrote("before and after", directory.contact_sheet());
  note_time(directory, "evaluate", watch);
}

}  // namespace cnerf::pipeline
