#pragma once
/// Everything a run can be told, in one struct: the option structs of the layers below, under the names that TOML files
/// and `--set` use. Defaults stand in those structs; a preset holds differences only.

#include <filesystem>
#include <string>
#include <vector>

#include "bake/mesh/options.h"
#include "bake/options.h"
#include "export/options.h"
#include "src/capture/load_capture.h"
#include "src/config/toml_binding.h"
#include "src/render/picture_options.h"
#include "src/train/stage1.h"
#include "src/train/stage2.h"

namespace cnerf {

struct ColorizerConfig {
  std::string spec;                  ///< "builtin", "reference:IMAGE…", "torchscript:FILE", …; empty = none given
  std::string keyframes;             ///< "VIEW=FILE;…": painted frames of the capture
  std::string hint_images;           ///< "VIEW=FILE;…": pictures that are transparent except for strokes
  std::string hints;                 ///< "x,y,VIEW,#rrggbb;…": dots, in pixels of the view's image file
  std::string prompt;                ///< a text for colorizers that take one
  double timeout_seconds = 60;       ///< for one batch of an exec: colorizer
  int reference_steps = 480;         ///< optimiser steps of a reference: colorizer's fit
  bool reference_on_builtin = true;  ///< that fit builds on the built-in network

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("spec", spec,
      "builtin, reference:IMAGE..., torchscript:FILE, onnx:FILE, caffe:PROTO,MODEL, exec:COMMAND or grey");
    v("keyframes", keyframes, "painted frames of the capture, VIEW=FILE;...");
    v("hint_images", hint_images, "pictures that are transparent except for strokes, VIEW=FILE;...");
    v("hints", hints, "dots of colour, x,y,VIEW,#rrggbb;... in pixels of the view's image file");
    v("prompt", prompt, "a text for colorizers that take one: exec: commands with {prompt} in them");
    v("timeout_seconds", timeout_seconds, Range{0.1, 1e6}, "an exec: colorizer that takes longer for a batch failed");
    v("reference_steps", reference_steps, Range{1, 1e6}, "optimiser steps of the fit to a reference: photograph");
    v("reference_on_builtin", reference_on_builtin, "that fit builds on what the built-in network makes of a picture");
  }
};

struct Config {
  std::string device = "auto";
  int threads = 0;
  CaptureOptions capture;
  Stage1Options stage1;
  ColorizerConfig colorizer;
  Stage2Options stage2;
  cnerf::bake::Options bake;
  exporting::VdbOptions vdb;
  exporting::WorldConvention world;
  cnerf::bake::MeshOptions mesh;
  exporting::ExrOptions exr;
  exporting::WebOptions web;
  PictureOptions render;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("device", device, Choice{"auto", "cpu", "cuda"}, "where fields are trained, rendered and baked");
    v("threads", threads, Range{0, 4096}, "threads to use; 0 = all cores");
    v.section("capture", capture);
    v.section("stage1", stage1);
    v.section("colorizer", colorizer);
    v.section("stage2", stage2);
    v.section("bake", bake);
    v.section("vdb", vdb);
    v.section("vdb", world);  // the keys that users know
    v.section("mesh", mesh);
    v.section("exr", exr);
    v.section("web", web);
    v.section("render", render);
  }
};

/// Keys that options had once; using one is an error that says what to do instead.
[[nodiscard]] const std::vector<RetiredKey>& retired_keys();

/// Reads a file over `config`.  @throws MissingInputError, UsageError naming file, key, value and what is legal.
void read_config_file(const std::filesystem::path& file, Config& config);
/// The same for what `to_toml` wrote into a run's folder, perhaps before some keys were retired.
/// @return  notes for the user: what it says that is no option any more
std::vector<std::string> read_run_config(const std::filesystem::path& file, Config& config);

/// Applies one `key.path=value`.  @throws UsageError.
void apply_setting(std::string_view setting, Config& config);

/// The whole configuration as TOML. Reading it back gives an equal Config, bit for bit.
[[nodiscard]] std::string to_toml(const Config& config);

/// Checks what ranges of single options cannot say, such as a minimum above its maximum.  @throws UsageError.
void check_consistency(const Config& config);

/// The folders presets are looked for in: `../share/cnerf/configs` beside the executable, then the source tree.
[[nodiscard]] std::vector<std::filesystem::path> preset_folders();
/// Names of all presets found, sorted.
[[nodiscard]] std::vector<std::string> preset_names();
/// The file of a preset.  @throws UsageError  listing the presets there are.
[[nodiscard]] std::filesystem::path preset_file(const std::string& name);

}  // namespace cnerf
