#pragma once
/// Stage 2: chroma by querying a 2-D colorizer (paper, Sec. "Color representation prediction").

#include <filesystem>
#include <functional>
#include <span>
#include <vector>

#include "src/base/observer.h"
#include "src/capture/capture.h"
#include "src/cluster/ranks.h"
#include "src/colorizer/colorizer.h"
#include "src/engine/engines.h"
#include "src/picture/contact_sheet.h"
#include "src/train/chroma/known_colors.h"
#include "src/train/chroma/stage2_options.h"
#include "src/train/luminance/view_cache.h"

namespace cnerf {

struct ColorModel;
class Injection;
class Questions;

struct Stage2Report {
  int accepted = 0, rejected = 0;  ///< patches
  double seconds = 0;
  double colorizer_seconds = 0;  ///< that queries took, beside the training but for the base patches
  double waited_seconds = 0;     ///< that the training waited for them
  double bake_ab_distance = 0;   ///< mean ab distance of the baked contract's colour to the per-pixel decode
};

/// What stage 2 works on.
struct Stage2Job {
  const Capture& capture;
  std::filesystem::path stage1;  ///< snapshot of the trained scene
  const Stage2Options& options;
  Colorizer& colorizer;
  std::span<const KnownColors> known;  ///< overrule the colorizer; key frames among them are the purification's bases
  std::filesystem::path take;          ///< snapshot that the result goes to; galleries of patches lie beside it
  bool resume = false;                 ///< go on with the take, if there is one
  ViewCache* views = nullptr;          ///< of this stage 1, for several colorizations; null = one of its own
  // Other ways to learn, for comparison; null = the method's own.
  Questions* questions = nullptr;                     ///< src/train/chroma/questioner.h
  const Injection* injection = nullptr;               ///< src/train/chroma/injection.h
  std::function<void(const ColorModel&)> watch = {};  ///< sees the model between steps, in no training time
  std::span<const Viewpoint> viewpoints = {};         ///< views beside the capture's, that `known` may name
  cluster::Ranks& ranks = cluster::alone();           ///< that share questions and steps; rank 0 writes
};

/// @throws UsageError  bases are picked, and key frames known, which are bases themselves
void check_bases(const PurifyOptions& options, std::span<const KnownColors> known);

/// Colorizes a trained scene. Several ranks share it as they share stage 1, each with a colorizer of its own. The
/// observer is offered pictures of held-out views, where there are any.
/// @throws ColorizerError, Interrupted, SnapshotError, UsageError.
Stage2Report train_stage2(const Stage2Job& job, const Engines& engines, Observer& observer);

/// Only asks for the base candidates, twelve patches spread over the views: what the whole scene would be coloured
/// like, in a minute. `stage2.purify.picked_bases` then picks those that are liked, by their numbers.
/// @throws ColorizerError, Interrupted, SnapshotError, UsageError.
[[nodiscard]] std::vector<Tile> base_candidates(const Stage2Job& job, const Engines& engines, Observer& observer);

}  // namespace cnerf
