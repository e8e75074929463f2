/// cnerf info: what a thing is.

#include <fmt/format.h>

#include <algorithm>

#include "export/vdb_reader.h"
#include "src/app/command.h"
#include "src/app/common_options.h"
#include "src/base/error.h"
#include "src/base/text.h"
#include "src/capture/load_capture.h"
#include "src/pipeline/run_directory.h"
#include "src/train/luminance/placement.h"
#include "src/train/luminance/stage1.h"
#include "src/train/scene.h"

namespace cnerf::app {
namespace fs = std::filesystem;
namespace {

struct InfoArguments {
  ConfigArguments config;
  std::string what;
};

std::string text_of(const Vec3d& v) {
  return fmt::format("({:.5g}, {:.5g}, {:.5g})", v.x, v.y, v.z);
}

std::string text_of(const Aabbd& box) {
  return text_of(box.min) + " to " + text_of(box.max);
}

template <typename... Values>
void line(const std::string& name, fmt::format_string<Values...> format, Values&&... values) {
  fmt::print("{:<18} {}\n", name + ":", fmt::format(format, std::forward<Values>(values)...));
}

void print_frame(const SceneFrame& frame) {
  line("box, world", "{}", text_of(frame.world_box()));
  line("scale", "{:.6g} box sides a world unit", frame.unit_per_world);
  line("cascades", "{}", frame.cascades);
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

void print_capture(const Capture& capture, const Config& config) {
  const View& first = capture.views.front();
  Aabbd cameras = Aabbd::empty();
  for (const View& view : capture.views) cameras.grow(view.world_from_camera.translation);
  line("capture", "{} ({})", capture.root.string(), capture.format);
  line("views", "{} of {} listed, {} held out", capture.views.size(), capture.listed_images,
       std::ranges::count_if(capture.views, [](const View& view) { return view.held_out; }));
  line("images", "{} x {}, {}, {}{}", first.image.width, first.image.height, depth_text(first.image.depth),
       lens_text(first.intrinsics.model), first.image.alpha.empty() ? "" : ", alpha");
  line("focal length", "{:.2f} pixels (first view)", first.intrinsics.fx);
  line("cameras", "{}", text_of(cameras));
  line("points", "{}", capture.points.size());
  if (capture.depth_range) line("depth range", "{:.4g} to {:.4g}", capture.depth_range->near, capture.depth_range->far);
  print_frame(place_scene(capture, config.stage1.placement));
  for (const std::string& note : capture.notes) line("note", "{}", note);
}

void print_scene(const fs::path& stage1, const fs::path& take) {
  const auto scene = Scene::load(stage1, take, cpu_engines());
  print_frame(scene->frame());
  if (scene->is_colorized()) line("colorizer", "{}", scene->colorizer());
}

void print_run(const pipeline::RunDirectory& directory) {
  const pipeline::RunRecord record = directory.record();
  line("run", "{} (cnerf {})", directory.root().string(), record.program_version);
  line("capture", "{}", record.capture.string());
  line("command", "{}", record.command_line);
  if (!record.stage1.finished) return line("stage 1", "not finished; cnerf train ... --resume goes on");
  line("stage 1", "{} steps, {}, {:.2f} dB on training pixels", record.stage1.steps,
       duration_text(record.stage1.seconds), record.stage1.train_psnr);
  print_scene(directory.stage1_snapshot(), {});
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(directory.root() / "takes", none)) {
    const std::string name = entry.path().filename().string();
    const auto take = directory.take_record(name);
    if (!take) {
      line("take", "{}: not finished", name);
      continue;
    }
    line("take", "{}: {}, {} patches accepted, {} rejected{}", name, take->colorizer, take->stage2.accepted,
         take->stage2.rejected, name == record.current_take ? " (current)" : "");
  }
}

void print_vdb(const fs::path& file) {
  const exporting::VdbSummary summary = exporting::summarize_vdb(file);
  line("volume", "{}", file.string());
  for (const auto& [name, value] : summary.metadata) line("  " + name, "{}", value);
  for (const exporting::VdbGridSummary& grid : summary.grids) {
    line(grid.name, "{}{}, {} voxels of {:.4g}, {}", grid.type, grid.half ? " as half" : "", grid.active_voxels,
         grid.voxel_size.x, text_of(grid.world_box));
    for (std::size_t c = 0; c < grid.min_value.size(); ++c) {
      line("", "component {}: {:.5g} to {:.5g}", c, grid.min_value[c], grid.max_value[c]);
    }
  }
}

bool is_snapshot(const fs::path& file) {
  return file.extension() == ".snapshot";
}

void print_snapshot(const fs::path& file) {
  const fs::path stage1 = file.parent_path().parent_path().parent_path() / "stage1.snapshot";
  line("snapshot", "{}", file.string());
  if (file.filename() == "take.snapshot" && fs::exists(stage1)) return print_scene(stage1, file);
  print_scene(file, {});
}

void info(const InfoArguments& arguments) {
  const Config config = resolve_config(arguments.config);
  const fs::path what = arguments.what;
  if (!fs::exists(what)) throw MissingInputError(what.string() + ": no such file or folder");
  if (pipeline::RunDirectory(what).exists()) return print_run(pipeline::RunDirectory(what));
  if (what.extension() == ".vdb") return print_vdb(what);
  if (is_snapshot(what)) return print_snapshot(what);
  print_capture(load_capture(what, config.capture), config);
}

}  // namespace

Work declare_info(CLI::App& app) {
  auto arguments = std::make_shared<InfoArguments>();
  app.add_option("WHAT", arguments->what, "A capture, a run, a .snapshot or a .vdb")->required();
  add_short_form(app, arguments->config, "--downscale", "capture.downscale");
  add_short_form(app, arguments->config, "--holdout", "capture.holdout");
  add_config_options(app, arguments->config);
  return [arguments](const auto&) { info(*arguments); };
}

}  // namespace cnerf::app
