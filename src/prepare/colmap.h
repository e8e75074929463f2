#pragma once
/// Camera poses by COLMAP, run as a program of the system: 3.8 as Debian has it, and newer ones that renamed options.

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "src/base/progress.h"
#include "src/prepare/photographs.h"

namespace cnerf::prepare {

struct PoseRecovery {
  std::filesystem::path model;           ///< folder of the model with the most images, lenses adjusted
  std::vector<std::size_t> model_sizes;  ///< registered images of all models, largest first
  std::string matching;                  ///< "exhaustive": all pairs; "guided": neighbours and those alike
  std::size_t pairs = 0;                 ///< matched
  double seconds = 0;
  double median_features = 0;  ///< per image; few mean blur or bare surfaces
};

/// Extracts features, matches and maps. Works in `work`, which keeps the database, the models and `colmap.log`; what an
/// earlier, interrupted call with the same images finished is not done again.
/// @param images    below `capture/images`
/// @param ordered   successive images are neighbours: frames of a clip
/// @throws DeviceError  no COLMAP: says how to install it.  @throws PosesError  it failed or placed too few images.
/// @throws Interrupted  what is done stays.
[[nodiscard]] PoseRecovery recover_poses(const std::vector<PreparedImage>& images, const std::filesystem::path& capture,
                                         const std::filesystem::path& work, bool ordered, const ProgressSink& progress);

/// Done share that COLMAP's log tells, from its last line "Processed file [3/50]" or "Registering image #4 (12)".
/// @param images  in all, for the last.  Public for its test.
[[nodiscard]] double share_in_log(std::string_view log, std::size_t images);

}  // namespace cnerf::prepare
