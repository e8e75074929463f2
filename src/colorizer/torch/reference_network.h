#pragma once
/// A small convolutional network fitted to a few photographs of one scene, from lightness to ab. Torch stays in the
/// .cpp.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "src/base/progress.h"
#include "src/colorizer/kinds.h"
#include "src/colorizer/torch/reference_images.h"

namespace cnerf {

class Encoder;  // encoder.h, which includes Torch

/// Everything that decides what a fit gives, besides photographs and seed.
struct ReferenceRecipe {
  std::vector<int> channels = {24, 48, 64, 96, 96};  ///< per level; the first is at half the patch's size
  int patch_size = 128;
  int steps = 480;
  int batch = 4;
  int shards = 4;  ///< a batch's fixed parts; each is one task, so that results do not depend on the threads
  double learning_rate = 4e-3;
  double weight_decay = 1e-2;
  /// Weights of the built-in network; empty = none. It is frozen, and the network fitted here reads what it makes of
  /// the picture: its inner features and its colours (ladder side-tuning, Sung et al. 2022). These paths start at zero,
  /// so that the photographs decide how much of it is used.
  std::filesystem::path builtin;
  /// A network that was trained on many more photographs; empty = none. It is frozen too, and each of its stages is
  /// read where the network fitted here has the same resolution, through 1x1 convolutions that start at zero.
  std::shared_ptr<const Encoder> encoder;
  /// How often a patch is learned from, and how many a shard holds of which it takes one a step: what the frozen
  /// networks make of a patch is kept with it.
  int patch_uses = 1, patches_held = 1;
  PatchDistortion distortion;

  /// All settings as text: part of a cache's key.
  [[nodiscard]] std::string text() const;
};

class ReferenceNetwork {
 public:
  /// Untrained, with weights drawn from `seed`.
  ReferenceNetwork(const ReferenceRecipe& recipe, std::span<const ReferenceImage> images, std::uint64_t seed);
  ~ReferenceNetwork();
  ReferenceNetwork(ReferenceNetwork&&) noexcept;

  /// Deterministic: the same photographs, recipe and seed give the same weights with any number of threads.
  /// @throws Interrupted  on Ctrl-C.
  void fit(std::span<const ReferenceImage> images, const ProgressSink& progress);

  /// Lightness patches of any size: ab and certainty are means of the answers about a patch and its mirror image.
  [[nodiscard]] ChromaBatch colorize(const LightnessBatch& patches) const;

  /// All weights, in a fixed order, and back.  @throws ContractError  on another count.
  [[nodiscard]] std::vector<float> weights() const;
  void set_weights(std::span<const float> weights);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// The recipe with the built-in network, and with an encoder, at about the same cost: what a frozen network makes of a
/// patch is a large part of a step's work, so that each patch is learned from several times.
void use_builtin(ReferenceRecipe& recipe, const std::filesystem::path& weights);
void use_encoder(ReferenceRecipe& recipe, std::shared_ptr<const Encoder> encoder);

/// The colorizer of a network fitted to the images of the request's argument, or of the weights that an earlier fit to
/// the same images with the same recipe and seed left in the request's cache folder.
/// @throws UsageError, MissingInputError, InputError  see make_colorizer.
/// @throws Interrupted  on Ctrl-C; nothing is kept of the fit.
[[nodiscard]] std::unique_ptr<Colorizer> fit_reference_colorizer(const ColorizerRequest& request,
                                                                 const ReferenceRecipe& recipe);

}  // namespace cnerf
