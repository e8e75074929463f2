#pragma once
/// Camera poses by COLMAP, run as a program of the system: 3.8 as Debian has it, and newer ones that renamed options.

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "src/base/options.h"
#include "src/base/progress.h"
#include "src/prepare/photographs.h"

namespace cnerf::prepare {

struct PoseOptions {
  std::string colmap = "colmap";
  std::string matching = "auto";
  std::string camera_model = "OPENCV";
  int exhaustive_up_to = 100;  // images up to which all pairs are matched
  int neighbours = 10;         // images matched on each side, where not all pairs are
  int alike = 20;              // images matched by look, where not all pairs are
  int features = 8192;
  int longest_side = 1600;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("colmap", colmap, "the COLMAP program");
    v("matching", matching, Choice{"auto", "exhaustive", "guided", "sequential"},
      "pairs to match: all; neighbours and those alike; neighbours. auto: all up to 100 images, then guided");
    v("camera_model", camera_model, Choice{"SIMPLE_RADIAL", "RADIAL", "OPENCV", "OPENCV_FISHEYE"},
      "lens model to estimate");
    v("features", features, Range{100, 100000}, "features per image, at most");
    v("longest_side", longest_side, Range{100, 20000}, "pixels at which features are looked for");
  }
};

struct PoseRecovery {
  std::filesystem::path model;           ///< folder of the model with the most images, lenses adjusted
  std::vector<std::size_t> model_sizes;  ///< registered images of all models, largest first
  std::string matching;                  ///< what was chosen
  std::size_t pairs = 0;                 ///< matched
  double seconds = 0;
  double median_features = 0;  ///< per image; few mean blur or bare surfaces
};

/// Extracts features, matches and maps. Works in `work`, which keeps the database, the models and `colmap.log`; what an
/// earlier, interrupted call with the same images and options finished is not done again.
/// @param images    below `capture/images`
/// @param ordered   successive images are neighbours: frames of a clip
/// @throws DeviceError  no COLMAP: says how to install it.  @throws PosesError  it failed or placed too few images.
/// @throws Interrupted  what is done stays.
[[nodiscard]] PoseRecovery recover_poses(const std::vector<PreparedImage>& images, const std::filesystem::path& capture,
                                         const std::filesystem::path& work, bool ordered, const PoseOptions& options,
                                         const ProgressSink& progress);

/// Done share that COLMAP's log tells, from its last line "Processed file [3/50]" or "Registering image #4 (12)".
/// @param images  in all, for the last.  Public for its test.
[[nodiscard]] double share_in_log(std::string_view log, std::size_t images);

}  // namespace cnerf::prepare
