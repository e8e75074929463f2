#pragma once
/// Colours that are changed until pictures are as a loss wants them, of fields whose luminance is given. With the
/// features of a reference image it is ARF (Zhang et al. 2022), with a text CLIP-NeRF's editing of appearance (Wang et
/// al. 2022).
///
/// As in ARF: colours are first matched to the reference's (there: mean and covariance; here, where luminance stays, by
/// the regression of its ab on its L*), then nearest-neighbour feature matching follows, with deferred
/// back-propagation: a picture is rendered whole without gradients, the loss's derivative is taken for its pixels, and
/// only that goes through the field. Unlike ARF: density stays too, which makes its content loss idle.

#include <filesystem>

#include "src/base/progress.h"
#include "src/capture/capture.h"
#include "src/compare/baselines/picture_loss.h"
#include "src/train/chroma/stage2.h"

namespace cnerf::compare {

/// What is transferred to what.
struct StyleJob {
  const Capture& capture;
  std::filesystem::path stage1;  ///< snapshot
  const PictureLoss& loss;
  const LabPicture* reference;   ///< whose colours are matched first; null = none are
  const Stage2Options& options;  ///< the field's size, learning rates and seed are used
  int steps = 0;                 ///< pictures, of training views in turn
  std::filesystem::path take;    ///< snapshot that the result goes to
  std::string colorizer;         ///< that the take names
};
/// Trains a photometric colour field on the loss.
/// @return  seconds
/// @throws Interrupted  without leaving anything; SnapshotError; UsageError for views that are too small.
double transfer_style(const StyleJob& job, const Engines& engines, Observer& observer);

/// A training view as the colorizer colours it: the middle one of the list.
[[nodiscard]] LabPicture colorized_view(const Capture& capture, const std::filesystem::path& stage1_snapshot,
                                        Colorizer& colorizer, const Engines& engines);
/// A colour image, its shorter side at most `kStyleSide` pixels.  @throws MissingInputError, InputError.
[[nodiscard]] LabPicture reference_image(const std::filesystem::path& file);

inline constexpr int kStyleSide = 192;  ///< pixels of the shorter side at which features are compared

}  // namespace cnerf::compare
