#pragma once
/// Everything a run can be told, in one struct: the option structs of the layers below, under the names that TOML files
/// and `--set` use. Defaults stand in those structs; a preset holds differences only.

#include <filesystem>
#include <string>
#include <vector>

#include "bake/options.h"
#include "bake/splat/options.h"
#include "export/options.h"
#include "src/capture/load_capture.h"
#include "src/colorizer/colorizer_options.h"
#include "src/config/toml_binding.h"
#include "src/field/finish.h"
#include "src/render/picture_options.h"
#include "src/train/chroma/stage2_options.h"
#include "src/train/luminance/stage1_options.h"

namespace cnerf {

struct Config {
  std::string device = "auto";
  std::string kernels = "auto";
  int threads = 0;
  std::string max_memory, image_memory;
  CaptureOptions capture;
  Stage1Options stage1;
  ColorizerOptions colorizer;
  Stage2Options stage2;
  cnerf::bake::Options bake;
  exporting::VdbOptions vdb;
  exporting::WorldConvention world;
  cnerf::bake::MeshOptions mesh;
  cnerf::bake::SplatOptions splat;
  exporting::WebOptions web;
  PictureOptions render;
  Finish finish;
  std::filesystem::path file;  ///< of the run or take that it was read from; no option

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("device", device, Choice{"auto", "cpu", "cuda"}, "where fields are trained, rendered and baked");
    v("kernels", kernels, Choice{"auto", "generic", "avx2", "avx512", "avx512bf16"},
      "instructions of the processor at most; avx512bf16 rounds what nets multiply to bf16");
    v("threads", threads, Range{0, 4096}, "threads to use; 0 = all cores");
    v("max_memory", max_memory,
      "memory the program may take, as 8G; needing more ends it with exit code 71, or 64 where that is known before");
    v("image_memory", image_memory,
      "memory for photographs, as 4G, and as much on a GPU; the rest lies in a file of the run's folder, which is read "
      "as "
      "it is needed; empty: a quarter of the machine's");
    v.section("capture", capture);
    v.section("stage1", stage1);
    v.section("colorizer", colorizer);
    v.section("stage2", stage2);
    v.section("bake", bake);
    v.section("vdb", vdb);
    v.section("vdb", world);  // the keys that users know
    v.section("mesh", mesh);
    v.section("splat", splat);
    v.section("web", web);
    v.section("render", render);
    v.section("finish", finish);
  }
};

/// Keys that options had once; using one is an error that says what to do instead.
[[nodiscard]] const std::vector<RetiredKey>& retired_keys();

/// Reads what `to_toml` wrote into a run's folder, perhaps before some keys were retired, over `config`.
/// @return  notes for the user: what it says that is no option any more
/// @throws MissingInputError, UsageError naming file, key, value and what is legal.
std::vector<std::string> read_run_config(const std::filesystem::path& file, Config& config);

/// The whole configuration as TOML. Reading it back gives an equal Config, bit for bit.
[[nodiscard]] std::string to_toml(const Config& config);

/// Checks what ranges of single options cannot say, such as a minimum above its maximum.
/// @throws UsageError  naming the file that it was read from, and the options.
void check_consistency(const Config& config);

/// The folders presets are looked for in: `../share/cnerf/configs` beside the executable, then the source tree.
[[nodiscard]] std::vector<std::filesystem::path> preset_folders();
/// Names of all presets found, sorted.
[[nodiscard]] std::vector<std::string> preset_names();
/// The file of a preset.  @throws UsageError  listing the presets there are.
[[nodiscard]] std::filesystem::path preset_file(const std::string& name);

}  // namespace cnerf
