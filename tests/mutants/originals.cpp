#include "tests/mutants/originals.h"

#include <fmt/format.h>

#include <atomic>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <thread>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/picture/exr_writer.h"
#include "tests/capture/fixtures.h"
#include "tests/mutants/program_captures.h"
#include "tests/support/onnx_model.h"

namespace cnerf::mutants {
namespace {
namespace fs = std::filesystem;
using Words = std::vector<std::string>;

Words joined(Words a, const Words& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

void call(const Workshop& workshop, const Words& arguments) {
  const Outcome outcome =
      run_limited(joined({workshop.program.string()}, arguments), workshop.folder / "calls",
                  {workshop.limits.wall * 4, workshop.limits.address_bytes, workshop.limits.sanitized});
  if (outcome.exit_code == 0) return;
  throw InputError(workshop.program.string(), arguments.front(),
                   fmt::format("an original cannot be made: exit code {}, signal {}: {}", outcome.exit_code,
                               outcome.signal, outcome.err));
}

fs::path copied(const fs::path& from, const fs::path& to) {
  fs::create_directories(to.parent_path());
  fs::copy(from, to, fs::copy_options::recursive);
  return to;
}

// ---- captures -------------------------------------------------------------------------------------------------------

/// A capture whose first image is `images/0.EXTENSION`; the others are PNG.
fs::path capture_with_image(const fs::path& folder, const std::string& extension,
                            const std::function<void(const fs::path&)>& write) {
  nlohmann::json poses = test::write_transforms(folder);
  const std::string name = "images/0." + extension;
  write(folder / name);
  poses["frames"][0]["file_path"] = name;
  test::write_json(folder / "transforms.json", poses);
  return folder;
}

void write_jpeg(const fs::path& file) {
  cv::Mat1b image(test::kHeight, test::kWidth);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) image(y, x) = test::grey_value(x, y);
  }
  cv::imwrite(file.string(), image);
}

void write_exr(const fs::path& file) {
  std::vector<float> values;
  for (int i = 0; i < test::kWidth * test::kHeight; ++i) values.push_back(float(i % 97) / 97);
  cnerf::write_exr(file, {test::kWidth, test::kHeight, {{"Y", values}}, {}});
}

fs::path colmap_capture(const fs::path& folder, bool is_text) {
  test::write_colmap_images(folder / "images");
  if (is_text) {
    test::write_colmap_text(folder / "sparse");
  } else {
    test::write_colmap_binary(folder / "sparse");
  }
  return folder;
}

// ---- colorizers -----------------------------------------------------------------------------------------------------

fs::path colorizers(const fs::path& folder) {
  constexpr const char* kSidecar = "input = \"L100\"\noutput = \"ab\"\n";
  fs::create_directories(folder);
  test::write_grey_image(folder / "picture.png", 16, 12);
  write_file(folder / "net.onnx", test::onnx_convolution({0.5F, -0.5F}, {0, 0}, {1, 12, 16}));
  write_file(folder / "net.onnx.toml", kSidecar);
  fs::copy_file(fs::path(CNERF_SOURCE_DIR) / "src/colorizer/weights/colorizer.weights", folder / "net.weights");
  // TorchScript is written by a program of its own: few link LibTorch.
  const Outcome made = run_limited({CNERF_TORCHSCRIPT_MODULE, (folder / "net.pt").string()}, folder / "calls",
                                   {std::chrono::seconds(120), 0, false});
  fs::remove_all(folder / "calls");
  if (made.exit_code != 0) throw InputError(folder / "net.pt", "TorchScript", "cannot be made: " + made.err);
  write_file(folder / "net.pt.toml", kSidecar);
  return folder;
}

Step coloring_by(const std::string& spec) {
  return {{"colorize-image", "{}/picture.png", "{}/out.png", "--colorizer", spec, "--threads", "1"}, ""};
}

// ---- runs and bakes -------------------------------------------------------------------------------------------------

Words quiet() {
  return {"--threads", "1", "--progress", "quiet"};
}

/// Bakes, and keeps the journal, which is gone when the bake is finished.
void bake_with_journal(const Workshop& workshop, const fs::path& run, const Words& options) {
  const fs::path journal = run / "bakes/grey/unfinished.bake", kept = workshop.folder / "kept.bake";
  std::atomic<bool> is_finished = false;
  std::thread watcher([&] {
    std::error_code none;
    while (!is_finished && !fs::exists(kept)) fs::create_hard_link(journal, kept, none);
  });
  try {
    call(workshop, joined({"bake", run.string()}, options));
  } catch (...) {
    is_finished = true;
    watcher.join();
    throw;
  }
  is_finished = true;
  watcher.join();
  if (!fs::exists(kept)) throw InputError(journal, "journal", "was not seen while the bake ran");
}

/// Makes the manifest's size and checksum of the volume those of the file.
void sign_volume(const fs::path& bake) {
  const fs::path manifest = bake / "manifest.json";
  auto json = nlohmann::ordered_json::parse(read_text_file(manifest));
  for (auto& file : json.at("files")) {
    if (file.at("name") != "volume.vdb") continue;
    file["bytes"] = fs::file_size(bake / "volume.vdb");
    file["sha256"] = sha256_of_file(bake / "volume.vdb");
  }
  write_file(manifest, json.dump(2));
}

/// What somebody painted on a view, and at a viewpoint.
constexpr const char* kStrokes = R"({
 "revision": 3, "everywhere": true,
 "strokes": [
  {"id": "s1", "view": "images/view_001.png", "kind": "paint", "color": "#c08040", "word": "jacket", "size": 0.2,
   "softness": 0.5, "reach": 1, "points": [[0.1, 0.2, 1], [0.6, 0.7, 0.5]]},
  {"id": "s2", "view": "door", "kind": "exact", "size": 0.1, "points": [[0.5, 0.5, 1]]},
  {"id": "s3", "view": "images/view_001.png", "kind": "erase", "size": 0.05, "hidden": false, "points": [[0.3, 0.4, 1]]}],
 "viewpoints": [
  {"name": "door", "position": [0, -3, 1], "rotation": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
   "lens": {"width": 24, "height": 16, "fx": 20, "fy": 20, "cx": 12, "cy": 8}}]
})";

Words reading(const char* command, const Words& options) {
  return joined({command}, joined(options, quiet()));
}

/// The commands on a run and its take, which lies in `{}/run`.
Step rendering(const Words& more) {
  const Words options = {"{}/run", "--path", "held-out", "--format", "png", "-o", "{}/out", "--device", "cpu"};
  return {joined(reading("render", joined(options, more)), least_options()), ""};
}

void add_captures(const Workshop& workshop, std::vector<Kind>& kinds) {
  const fs::path folder = workshop.folder;
  const std::vector<Step> steps = {
      {reading("info", {"{}"}), ""},
      {joined(reading("train", {"{}", "-o", "{}/run", "--device", "cpu"}), least_options()), ""}};
  const fs::path sample = make_capture(workshop);
  kinds.push_back({"transforms.json", sample, "transforms.json", true, Format::kPlain, steps});
  const fs::path binary = colmap_capture(folder / "colmap-binary", false),
                 text = colmap_capture(folder / "colmap-text", true);
  for (const char* name : {"cameras", "images", "points3D"}) {
    const std::string file = std::string("sparse/") + name;
    kinds.push_back({std::string("colmap ") + name + ".bin", binary, file + ".bin", false, Format::kPlain, steps});
    kinds.push_back({std::string("colmap ") + name + ".txt", text, file + ".txt", true, Format::kPlain, steps});
  }
  test::write_llff(folder / "llff");
  kinds.push_back({"poses_bounds.npy", folder / "llff", "poses_bounds.npy", false, Format::kPlain, steps});
  kinds.push_back({"PNG image", sample, "images/view_000.png", false, Format::kPlain, steps});
  kinds.push_back({"JPEG image", capture_with_image(folder / "jpeg", "jpg", write_jpeg), "images/0.jpg", false,
                   Format::kPlain, steps});
  kinds.push_back({"EXR image", capture_with_image(folder / "exr", "exr", write_exr), "images/0.exr", false,
                   Format::kPlain, steps});
  add_program_captures(folder / "programs", steps, kinds);
}

void add_runs(const Workshop& workshop, std::vector<Kind>& kinds) {
  const fs::path stage = workshop.folder / "trained", run = stage / "run", capture = workshop.folder / "capture";
  const Words cpu = {"--device", "cpu"};
  const Words baking = joined(reading("bake", {"{}/run", "--take", "grey", "--device", "cpu"}), least_options());
  call(workshop, joined(reading("train", {capture.string(), "-o", run.string(), "--device", "cpu"}), least_options()));
  call(workshop, joined(reading("colorize", {run.string(), "--take", "grey", "--colorizer", "grey", "--device", "cpu"}),
                        least_options()));
  fs::copy_file(capture / "transforms.json", stage / "path.json");
  fs::copy_file(run / "config.toml", stage / "options.toml");
  write_file(stage / "strokes.json", kStrokes);

  const Step info{reading("info", {"{}/run"}), ""};
  const auto info_of = [](const std::string& file) { return Step{reading("info", {"{}/" + file}), ""}; };
  const Step coloring{joined(reading("colorize", {"{}/run", "--take", "new", "--colorizer", "grey", "--device", "cpu"}),
                             least_options()),
                      ""};
  const Step training{
      joined(reading("train", {capture.string(), "-o", "{}/again", "--config", "{}/options.toml", "--device", "cpu"}),
             least_options()),
      ""};
  const Step path{joined(reading("render", {"{}/run", "--path", "{}/path.json", "--format", "png", "-o", "{}/out",
                                            "--device", "cpu"}),
                         least_options()),
                  ""};
  const auto add = [&](const char* name, const char* file, bool is_text, Format format, std::vector<Step> steps) {
    kinds.push_back({name, stage, file, is_text, format, std::move(steps)});
  };
  const Step painting{joined(reading("colorize", {"{}/run", "--take", "new", "--colorizer", "grey", "--device", "cpu",
                                                  "--strokes", "{}/strokes.json"}),
                             least_options()),
                      ""};
  add("strokes.json", "strokes.json", true, Format::kPlain, {painting});
  add("stage1.snapshot", "run/stage1.snapshot", false, Format::kSnapshot,
      {info_of("run/stage1.snapshot"), rendering({})});
  add("take.snapshot", "run/takes/grey/take.snapshot", false, Format::kSnapshot,
      {info_of("run/takes/grey/take.snapshot"), rendering({"--baked"})});
  add("run.json", "run/run.json", true, Format::kPlain, {info, rendering({})});
  add("take.json", "run/takes/grey/take.json", true, Format::kPlain, {info, rendering({})});
  add("run config.toml", "run/config.toml", true, Format::kPlain, {coloring});
  add("take config.toml", "run/takes/grey/config.toml", true, Format::kPlain, {rendering({"--take", "grey"})});
  add("--config FILE.toml", "options.toml", true, Format::kPlain, {training});
  add("--path FILE.json", "path.json", true, Format::kPlain, {path});

  const Words options = joined({"--take", "grey", "--device", "cpu"}, joined(quiet(), least_options()));
  const fs::path baked = copied(stage, workshop.folder / "baked");
  bake_with_journal(workshop, baked / "run", options);
  const fs::path stopped = copied(stage, workshop.folder / "stopped");
  fs::create_directories(stopped / "run/bakes/grey");
  fs::rename(workshop.folder / "kept.bake", stopped / "run/bakes/grey/unfinished.bake");
  kinds.push_back(
      {"unfinished.bake", stopped, "run/bakes/grey/unfinished.bake", false, Format::kJournal, {{baking, ""}}});

  const fs::path bake = copied(baked / "run/bakes/grey", workshop.folder / "bake");
  const Step voxels{reading("render", {"{}", "--path", "cameras", "--format", "png", "-o", "{}/out"}), ""};
  kinds.push_back({"volume.vdb",
                   bake,
                   "volume.vdb",
                   false,
                   Format::kPlain,
                   {{reading("info", {"{}/volume.vdb"}), ""}, voxels},
                   sign_volume});
  const Step view{{"view", "{}", "--no-browser", "--set", "web.resolution=16"}, "Ctrl-C ends it"};
  kinds.push_back({"manifest.json", bake, "manifest.json", true, Format::kPlain, {voxels, view}});
  kinds.push_back({"bundle.json (view)", make_bundle(workshop), "bundle.json", true, Format::kPlain, {view}});
}

void add_colorizers(const Workshop& workshop, std::vector<Kind>& kinds) {
  const fs::path folder = colorizers(workshop.folder / "colorizers");
  const auto add = [&](const char* name, const char* file, bool is_text, Format format, const char* spec) {
    kinds.push_back({name, folder, file, is_text, format, {coloring_by(spec)}});
  };
  add("colorizer.weights", "net.weights", false, Format::kWeights, "builtin:{}/net.weights");
  add("onnx", "net.onnx", false, Format::kPlain, "onnx:{}/net.onnx");
  add("onnx sidecar", "net.onnx.toml", true, Format::kPlain, "onnx:{}/net.onnx");
  add("torchscript", "net.pt", false, Format::kPlain, "torchscript:{}/net.pt");
  add("torchscript sidecar", "net.pt.toml", true, Format::kPlain, "torchscript:{}/net.pt");
  add("picture to colour", "picture.png", false, Format::kPlain, "onnx:{}/net.onnx");
}

/// What an earlier version wrote.
void add_old_files(const Workshop& workshop, std::vector<Kind>& kinds) {
  const fs::path old = copied(fs::path(CNERF_SOURCE_DIR) / "tests/compatibility/649cb93", workshop.folder / "649cb93");
  fs::remove_all(old / "pictures");
  fs::remove_all(old / "voxels");
  const Step render = rendering({"--capture", "{}/capture"}), info{reading("info", {"{}/run"}), ""};
  const Step voxels{reading("render", {"{}/run/bakes/reference", "-o", "{}/out"}), ""};
  const auto add = [&](const char* name, const char* file, bool is_text, Format format, std::vector<Step> steps) {
    kinds.push_back(
        {std::string("649cb93 ") + name, old, std::string("run/") + file, is_text, format, std::move(steps)});
  };
  add("run.json", "run.json", true, Format::kPlain, {info, render});
  add("stage1.snapshot", "stage1.snapshot", false, Format::kSnapshot, {info, render});
  add("take.snapshot", "takes/reference/take.snapshot", false, Format::kSnapshot, {render});
  add("take.json", "takes/reference/take.json", true, Format::kPlain, {info, render});
  add("take config.toml", "takes/reference/config.toml", true, Format::kPlain, {render});
  add("manifest.json", "bakes/reference/manifest.json", true, Format::kPlain, {voxels});
  add("volume.vdb", "bakes/reference/volume.vdb", false, Format::kPlain,
      {{reading("info", {"{}/run/bakes/reference/volume.vdb"}), ""}, voxels});
  kinds.back().amend = [](const fs::path& stage) { sign_volume(stage / "run/bakes/reference"); };
}

}  // namespace

Words least_options() {
  Words options;
  for (const char* setting : {"stage1.steps=4",
                              "stage1.samples_per_step=1024",
                              "stage1.checkpoint_every=2",
                              "stage1.steps_per_box=32",
                              "stage1.grid.levels=2",
                              "stage1.grid.log2_rows=10",
                              "stage1.grid.finest_resolution=32",
                              "colorizer.reference_steps=2",
                              "stage2.patches=2",
                              "stage2.patch_size=16",
                              "stage2.rays_per_patch=64",
                              "stage2.working_resolution=32",
                              "stage2.distill_steps=2",
                              "stage2.colorizer_batch=2",
                              "stage2.grid.levels=2",
                              "stage2.grid.log2_rows=10",
                              "stage2.grid.finest_resolution=32",
                              "stage2.purify.enabled=false",
                              "stage2.purify.base_images=2",
                              "bake.resolution=16",
                              "web.resolution=16",
                              "render.frames=2",
                              "render.short_side=16",
                              "render.steps_per_box=32"}) {
    options.insert(options.end(), {"--set", setting});
  }
  return options;
}

fs::path make_capture(const Workshop& workshop) {
  const fs::path capture = workshop.folder / "capture";
  if (!fs::exists(capture)) {
    call(workshop, {"sample", "-o", capture.string(), "--views", "4", "--width", "24", "--height", "16",
                    "--samples-per-pixel", "1"});
  }
  return capture;
}

fs::path make_bundle(const Workshop& workshop) {
  const fs::path run = workshop.folder / "shown", bundle = run / "bakes/grey/web";
  if (fs::exists(bundle)) return bundle;
  const Words options = joined(quiet(), least_options());
  call(workshop, joined({"train", make_capture(workshop).string(), "-o", run.string(), "--device", "cpu"}, options));
  call(workshop, joined({"bake", run.string(), "--format", "web", "--device", "cpu"}, options));
  if (!fs::exists(bundle / "index.html")) write_file(bundle / "index.html", "<!doctype html><title>bundle</title>");
  return bundle;
}

std::vector<Kind> make_originals(const Workshop& workshop) {
  fs::remove_all(workshop.folder);
  fs::create_directories(workshop.folder);
  // A build without the viewer's page shows this one.
  write_file(workshop.folder / "page/index.html", "<!doctype html><title>page</title>");
  ::setenv("CNERF_PAGE", (workshop.folder / "page").c_str(), 1);
  std::vector<Kind> kinds;
  add_captures(workshop, kinds);
  add_runs(workshop, kinds);
  add_colorizers(workshop, kinds);
  add_old_files(workshop, kinds);
  return kinds;
}

}  // namespace cnerf::mutants
