#include "src/config/config.h"

#include <algorithm>
#include <set>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/plugin.h"
#include "src/base/text.h"
#include "src/config/toml_binding.h"

namespace cnerf {
namespace fs = std::filesystem;
const std::vector<RetiredKey>& retired_keys() {
  static const std::vector<RetiredKey> keys{
      {"exr.lab_names", "", "'lab'", "the channels are Lab.L, Lab.a and Lab.b"},
      {"exr.mip", "", "false", "textures are written as lines; exrmaketiled of OpenEXR makes mip-map levels"},
      {"web.density", "", "'r8'", "density has 8 bits on a cubic scale"},
      {"web.photo_quality", "", "82", "it is a constant; web.photo_side says how large photographs are"},
      {"bake.seen_transmittance", "", "0.001", "it is a constant"},
      {"vdb.half", "", "true", "values have 16 bits, density 32 where 16 do not hold it"},
      {"mesh.gutter", "", "2", "charts lie two texels apart on each side"},
      {"mesh.views_per_texel", "", "6", "a texel is averaged over six views"},
      {"mesh.adaptivity", "", "0.02", "flat parts are merged as far as two hundredths"},
      {"mesh.ray_inside", "", "4.0", "a texel's ray ends four voxels inside the surface"},
      {"mesh.ray_outside", "", "2.0", "a texel's ray starts two voxels outside the surface"},
      {"vdb.dilation", "bake.dilation", "", ""},
      {"compare.positional_budget", "", "4.0", "it is a constant"},
      {"compare.positional_learning_rate", "", "5e-04", "it is that of Mildenhall et al. 2020"},
      {"compare.positional_final_learning_rate", "", "5e-05", "it is that of Mildenhall et al. 2020"},
      {"compare.positional_geometry", "", "'shared'", "colours stand on the stage 1 that all methods share"},
      {"compare.positional_trains_encoding", "", "false", "the encoding stays fixed, as in the paper"},
      {"compare.style_reference", "", "''", "cnerf compare has --style-reference"},
      {"compare.style_network", "", "''", "features are those of the AlexNet of --lpips-weights"},
      {"compare.style_steps", "", "160", "in cnerf compare they follow stage2.patches"},
      {"stage1.grid.features", "", "4", "a row has 4 features"},
      {"stage2.grid.features", "", "4", "a row has 4 features"},
      {"stage1.occupancy.decay", "", "0.5", "it is a constant"},
      {"stage1.occupancy.optical_thickness", "", "0.03", "it is a constant"},
      {"render.min_transmittance", "", "0.001", "it is a constant"},
      {"vdb.emission", "", "false", "multiply density and color where the volume is rendered"},
      {"vdb.normalize_density", "", "false", "divide by the manifest's max_density where the volume is read"},
      {"vdb.padding", "", "1", "grids have one voxel of zeros around them"},
      {"stage1.sampling", "", "'pixels'", "training draws independent pixels"},
      {"stage1.patch_size", "", "32", "training draws independent pixels"},
      {"stage1.occupancy.resolution", "", "128", "it is a constant"},
      {"stage1.placement.scale", "", "0.0", "stage1.placement.cascades and stage1.placement.centre place the box"},
      {"stage1.placement.fixed_centre", "stage1.placement.centre", "false", ""},
      {"stage1.placement.centre_x", "stage1.placement.centre", "0.0", ""},
      {"stage1.placement.centre_y", "stage1.placement.centre", "0.0", ""},
      {"stage1.placement.centre_z", "stage1.placement.centre", "0.0", ""},
      {"stage2.questions", "", "'patches'", "cnerf compare has the method that asks about whole views"},
      {"stage2.injection", "", "'classification'", "cnerf compare has the method with a photometric loss"},
      {"stage2.rebalancing", "", "0.0", "all classes weigh alike"},
      {"stage2.cached_weight", "", "0.99", "it is a constant"},
      {"stage2.scale_min", "", "0.3", "it is a constant"},
      {"stage2.scale_max", "", "0.7", "it is a constant"},
      {"stage2.known_share", "", "1.0", "stage2.rays_per_patch says how many"},
      {"stage2.purify.base_scale", "", "0.7", "it is a constant"},
      {"stage2.purify.histogram", "", "'ab'", "histograms are of ab"},
  };
  return keys;
}

std::vector<std::string> read_run_config(const fs::path& file, Config& config) {
  config.file = file;
  return read_toml(read_text_file(file), file.string(), fields_of(config), retired_keys(), Retired::kLeftOut);
}

std::string to_toml(const Config& config) {
  Config copy = config;  // `visit` is for reading and writing alike, so it is not const
  return write_toml(fields_of(copy));
}

void check_consistency(const Config& config) {
  const std::string where = config.file.empty() ? "" : config.file.string() + ", with what is set besides: ";
  const auto check_grid = [&where](const std::string& section, const HashGridOptions& grid) {
    if (grid.coarsest_resolution <= grid.finest_resolution) return;
    throw UsageError(where + section + ".coarsest_resolution: expected at most " + section +
                     ".finest_resolution, got " + std::to_string(grid.coarsest_resolution) + " against " +
                     std::to_string(grid.finest_resolution));
  };
  check_grid("stage1.grid", config.stage1.grid);
  check_grid("stage2.grid", config.stage2.grid);
}

std::vector<fs::path> preset_folders() {
  return data_places("configs");
}

std::vector<std::string> preset_names() {
  std::set<std::string> names;
  for (const fs::path& folder : preset_folders()) {
    std::error_code failure;
    for (const auto& entry : fs::directory_iterator(folder, failure)) {
      if (entry.path().extension() == ".toml") names.insert(entry.path().stem().string());
    }
  }
  return {names.begin(), names.end()};
}

fs::path preset_file(const std::string& name) {
  for (const fs::path& folder : preset_folders()) {
    const fs::path file = folder / (name + ".toml");
    std::error_code failure;
    if (fs::is_regular_file(file, failure)) return file;
  }
  const std::vector<std::string> names = preset_names();
  const std::string meant = nearest_name(name, names);
  throw UsageError("--preset: no preset '" + name + "'" + (meant.empty() ? "" : "; did you mean '" + meant + "'?") +
                   " (there are: " + joined(names, ", ") + "; a file of your own goes to --config)");
}

}  // namespace cnerf
