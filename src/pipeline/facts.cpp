#include "src/pipeline/facts.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "export/vdb_reader.h"
#include "src/base/error.h"
#include "src/base/statistics.h"
#include "src/base/text.h"
#include "src/capture/arrangement.h"
#include "src/capture/image_header.h"
#include "src/capture/load_capture.h"
#include "src/color/colorspace_math.h"
#include "src/pipeline/run_directory.h"
#include "src/prepare/photographs.h"
#include "src/prepare/prepare.h"
#include "src/train/luminance/learned_views.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;
namespace {

std::string text_of(const Vec3d& v) {
  return fmt::format("({:.5g}, {:.5g}, {:.5g})", v.x, v.y, v.z);
}

std::string text_of(const Aabbd& box) {
  return text_of(box.min) + " to " + text_of(box.max);
}

/// Facts, told line by line.
class Report {
 public:
  template <typename... Values>
  void line(std::string name, fmt::format_string<Values...> format, Values&&... values) {
    facts_.push_back({std::move(name), fmt::format(format, std::forward<Values>(values)...)});
  }
  [[nodiscard]] std::vector<Fact> taken() { return std::move(facts_); }

 private:
  std::vector<Fact> facts_;
};

void add_frame(Report& report, const SceneFrame& frame) {
  report.line("box, world", "{}", text_of(frame.world_box()));
  report.line("scale", "{:.6g} box sides a world unit", frame.unit_per_world);
  report.line("cascades", "{}", frame.cascades);
}

void add_sky(Report& report, const Scene& scene) {
  const auto sky = scene.sky();
  if (!sky) return;
  std::vector<float> light;
  for (std::size_t p = 0; p < sky->rgb.size(); p += 3) {
    light.push_back(luminance_of(Vec3f{sky->rgb[p], sky->rgb[p + 1], sky->rgb[p + 2]}));
  }
  report.line("sky", "luminance {:.2f}, {:.2f} to {:.2f} for nine tenths of it", median(light), quantile(light, 0.05),
              quantile(light, 0.95));
}

std::string lens_text(LensModel model) {
  switch (model) {
    case LensModel::kPinhole:
      return "pinhole";
    case LensModel::kOpenCv:
      return "OpenCV distortion";
    case LensModel::kOpenCvFisheye:
      return "OpenCV fisheye";
  }
  return "";
}

std::string depth_text(PixelDepth depth) {
  return depth == PixelDepth::kU8 ? "8-bit" : depth == PixelDepth::kU16 ? "16-bit" : "float";
}

/// What the header tells beside size and depth.
std::string channels_text(const fs::path& image) {
  const auto header = stated_header(image);
  if (!header) return "";
  return std::string(header->has_color ? ", three channels" : "") + (header->has_alpha ? ", alpha" : "");
}

void add_capture(Report& report, const Capture& capture) {
  const View& first = capture.views.front();
  Aabbd cameras = Aabbd::empty();
  for (const View& view : capture.views) cameras.grow(view.world_from_camera.translation);
  report.line("capture", "{} ({})", capture.root.string(), capture.format);
  report.line("views", "{} of {} listed, {} held out", capture.views.size(), capture.listed_images,
              std::ranges::count_if(capture.views, &View::held_out));
  report.line("images", "{} x {}, {}, {}{}", first.image.width, first.image.height, depth_text(first.image.depth),
              lens_text(first.intrinsics.model), channels_text(first.image_file));
  report.line("focal length", "{:.2f} pixels (first view)", first.intrinsics.fx);
  report.line("cameras", "{}, {}", text_of(cameras),
              arrangement_of(capture).forward_facing ? "all facing one way" : "around the scene");
  report.line("points", "{}", capture.points.size());
  if (const auto& range = capture.depth_range) report.line("depth range", "{:.4g} to {:.4g}", range->near, range->far);
  if (capture.bounds) report.line("bounds", "{}", text_of(*capture.bounds));
  for (const std::string& note : capture.notes) report.line("note", "{}", note);
}

/// Photographs that have no poses yet.
void add_photographs(Report& report, const fs::path& folder) {
  const std::vector<fs::path> files = prepare::list_photographs(folder);
  report.line("photographs", "{} in {}", files.size(), files.front().parent_path().string());
  if (const auto header = stated_header(files.front())) {
    report.line("images", "{}, {} (first one)", size_text(header->width, header->height), depth_text(header->depth));
  }
  report.line("cameras", "not known yet; `cnerf run` and `cnerf prepare` find them");
}

/// A film clip, whose frames have no poses yet.
void add_clip(Report& report, const fs::path& file) {
  report.line("clip", "{}", file.string());
  report.line("cameras", "not known yet; `cnerf run` and `cnerf prepare` choose frames and find them");
}

void add_scene(Report& report, const fs::path& stage1, const fs::path& take) {
  const auto scene = Scene::load(stage1, take, cpu_engines());
  add_frame(report, scene->frame());
  add_sky(report, *scene);
  if (scene->is_colorized()) report.line("colorizer", "{}", scene->colorizer());
}

/// A line that rises and falls with the values, over the views in their order; views are thinned out to its width.
std::string curve_text(const std::vector<double>& values) {
  constexpr std::size_t kWidest = 60;
  constexpr std::array<const char*, 8> kBars = {"\u2581", "\u2582", "\u2583", "\u2584",
                                                "\u2585", "\u2586", "\u2587", "\u2588"};
  const auto [least, most] = std::ranges::minmax(values);
  if (!(least < most)) return "";
  const std::size_t width = std::min(kWidest, values.size());
  std::string text;
  for (std::size_t x = 0; x < width; ++x) {
    const double share = (values[x * values.size() / width] - least) / (most - least);
    text += kBars[std::min<std::size_t>(kBars.size() - 1, std::size_t(share * double(kBars.size())))];
  }
  return text;
}

/// As the run's capture gives them; none where it does not lie there any more.
std::vector<Intrinsics> given_lenses(const RunDirectory& directory, const RunRecord& record) {
  try {
    Observer silent;
    return lenses_of(survey_capture(record.capture, directory.config("", silent).capture));
  } catch (const Error&) {
    return {};
  }
}

void add_learned(Report& report, const RunDirectory& directory, const RunRecord& record) {
  if (record.stage1.sky_views > 0) {
    report.line("sky seen", "{:.0f} % of the pixels, in {} views", 100 * record.stage1.sky_share,
                record.stage1.sky_views);
  }
  const LearnedViews learned = LuminanceModel::learned_views_in(directory.stage1_snapshot());
  std::vector<double> gains;
  for (const ViewCorrection& correction : learned.corrections) gains.push_back(double(correction.gain()));
  if (const std::string curve = gains.empty() ? "" : curve_text(gains); !curve.empty()) {
    report.line("exposure curve", "{}", curve);
  }
  const auto given = learned.lenses.empty() ? std::vector<Intrinsics>() : given_lenses(directory, record);
  for (const auto& [name, text] : facts_of(learned, given)) report.line(name, "{}", text);
}

void add_run(Report& report, const RunDirectory& directory) {
  const RunRecord record = directory.record();
  report.line("run", "{} (cnerf {})", directory.root().string(), record.program_version);
  report.line("capture", "{}", record.capture.string());
  report.line("command", "{}", record.command_line);
  if (!record.stage1.finished) return report.line("stage 1", "not finished; cnerf train ... --resume goes on");
  report.line("stage 1", "{} steps, {}, {:.2f} dB on training pixels", record.stage1.steps,
              duration_text(record.stage1.seconds), record.stage1.train_psnr);
  add_scene(report, directory.stage1_snapshot(), {});
  add_learned(report, directory, record);
  for (const std::string& name : directory.take_names()) {
    const auto take = directory.take_record(name);
    if (!take) {
      report.line("take", "{}: not finished", name);
      continue;
    }
    report.line("take", "{}: {}, {} patches accepted, {} rejected{}", name, take->colorizer, take->stage2.accepted,
                take->stage2.rejected, name == record.current_take ? " (current)" : "");
  }
}

void add_vdb(Report& report, const fs::path& file) {
  const exporting::VdbSummary summary = exporting::summarize_vdb(file);
  report.line("volume", "{}", file.string());
  for (const auto& [name, value] : summary.metadata) report.line("  " + name, "{}", value);
  for (const exporting::VdbGridSummary& grid : summary.grids) {
    report.line(grid.name, "{}{}, {} voxels of {:.4g}, {}", grid.type, grid.half ? " as half" : "", grid.active_voxels,
                grid.voxel_size.x, text_of(grid.world_box));
    if (grid.not_finite > 0) report.line("", "{} values are not finite", grid.not_finite);
    for (std::size_t c = 0; c < grid.min_value.size(); ++c) {
      report.line("", "component {}: {:.5g} to {:.5g}", c, grid.min_value[c], grid.max_value[c]);
    }
  }
}

bool is_snapshot(const fs::path& file) {
  return file.extension() == ".snapshot";
}

void add_snapshot(Report& report, const fs::path& file) {
  const fs::path stage1 = file.parent_path().parent_path().parent_path() / "stage1.snapshot";
  report.line("snapshot", "{}", file.string());
  if (file.filename() == "take.snapshot" && fs::exists(stage1)) return add_scene(report, stage1, file);
  add_scene(report, file, {});
}

}  // namespace

std::vector<Fact> facts_of(const fs::path& what, const CaptureOptions& options) {
  if (!fs::exists(what)) throw MissingInputError(what.string() + ": no such file or folder");
  Report report;
  if (RunDirectory(what).exists()) {
    add_run(report, RunDirectory(what));
  } else if (what.extension() == ".vdb") {
    add_vdb(report, what);
  } else if (is_snapshot(what)) {
    add_snapshot(report, what);
  } else if (prepare::needs_preparing(what)) {
    fs::is_directory(what) ? add_photographs(report, what) : add_clip(report, what);
  } else {
    add_capture(report, survey_capture(what, options));
  }
  return report.taken();
}

}  // namespace cnerf::pipeline
