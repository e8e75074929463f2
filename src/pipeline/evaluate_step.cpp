#include "src/pipeline/evaluate_step.h"

#include <fmt/format.h>

#include <optional>

#include "src/base/files.h"
#include "src/base/json_record.h"
#include "src/base/usage.h"
#include "src/evaluate/evaluate.h"
#include "src/picture/contact_sheet.h"
#include "src/picture/encode.h"
#include "src/pipeline/render_step.h"

namespace cnerf::pipeline {
namespace {

constexpr int kSheetRows = 6;

void say_metrics(const Metrics& metrics, Observer& observer) {
  const ViewMetrics& mean = metrics.mean;
  std::string text = fmt::format("{} views ({}): luminance {:.2f} dB", metrics.views.size(), metrics.split,
                                 mean.psnr_luminance.value_or(0));
  if (mean.ssim) text += fmt::format(", SSIM {:.3f}", *mean.ssim);
  if (mean.psnr_rgb) text += fmt::format(", RGB {:.2f} dB", *mean.psnr_rgb);
  if (mean.lpips) text += fmt::format(", LPIPS {:.3f}", *mean.lpips);
  if (mean.ab_error) text += fmt::format(", ab error {:.2f} (all grey {:.2f})", *mean.ab_error, *mean.ab_error_grey);
  if (mean.bake_ab_distance) text += fmt::format(", baked colour {:.2f} ab from per-pixel", *mean.bake_ab_distance);
  observer.say(text);
}

}  // namespace

void evaluate_step(const RunContext& context, const EvaluateJob& job, const Engines& engines, Observer& observer) {
  const RunDirectory& directory = context.directory;
  const StepLocks locks(directory, job.take.empty() ? directory.root() : directory.take_folder(job.take), observer);
  const Stopwatch watch;
  std::optional<Lpips> lpips;
  if (!job.lpips_weights.empty()) lpips.emplace(job.lpips_weights);  // read first: what is missing costs no rendering
  const auto scene = load_scene(directory, job.take, {}, engines);
  EvaluateOptions options;
  options.lpips = lpips ? &*lpips : nullptr;
  options.render = render_options(context.config);
  ContactSheet sheet({"input", "ours", "truth"});
  const auto add_to_sheet = [&](const EvaluatedView& view) {
    if (sheet.rows() >= kSheetRows) return;
    const Picture truth =
        view.truth ? picture_from_linear(view.truth->width, view.truth->height, view.truth->rgb) : Picture{};
    sheet.add_row({grey_picture(view.view.image), picture_of(view.ours, ShownColor::kDecoded), truth});
  };
  Metrics metrics = evaluate(*scene, context.capture, options, add_to_sheet, observer.progress_sink());
  metrics.take = job.take;
  metrics.colorizer = colorizer_name(directory, job.take);

  const std::string json = json_of(metrics).dump(2) + "\n";
  if (!job.take.empty()) write_file(directory.take_folder(job.take) / "metrics.json", json);
  write_file(directory.metrics_file(), json);
  write_png(directory.contact_sheet(), sheet.compose());
  say_metrics(metrics, observer);
  observer.wrote("metrics", directory.metrics_file());
  observer.wrote("before and after", directory.contact_sheet());
  note_time(directory, "evaluate", watch);
}

}  // namespace cnerf::pipeline
