#pragma once
/// Colorizer: what stage 2 asks for colours. Any 2-D colorizer fits behind it; none of its kinds is visible here.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "src/base/progress.h"
#include "src/colorizer/colorizer_options.h"

namespace cnerf {

/// Where a patch was cut from, for colorizers that work on a whole capture: a rectangle of a view, as shares of the
/// view's width and height. It says where, never which colour.
struct PatchOrigin {
  std::string view;  ///< name, as the capture has it
  double left = 0, top = 0, width = 1, height = 1;
  std::uint64_t query = 0;  ///< number of the question: a question that is repeated, say by --resume, keeps it
};

/// A batch of lightness patches. L* in 0..100.
struct LightnessBatch {
  int batch = 0, height = 0, width = 0;
  std::vector<float> lightness;           ///< [B, H, W]
  std::vector<PatchOrigin> origins = {};  ///< [B]; empty where patches are of no capture
};

/// The colorizer's answer; exactly one of `ab` and `logits` is filled.
struct ChromaBatch {
  int batch = 0, height = 0, width = 0;
  std::vector<float> ab;              ///< [B, 2, H, W] Lab a and b
  std::vector<float> logits;          ///< [B, 313, H, W] over the bins of ab_bins.h
  std::vector<float> certainty = {};  ///< [B, H, W] as `certainty_of` has it; empty where the colorizer does not say

  [[nodiscard]] bool has_distribution() const { return !logits.empty(); }
};

class Colorizer {
 public:
  virtual ~Colorizer() = default;

  /// Colours a batch. The answer has the batch's size and finite values; implementations check their own back end.
  /// @throws ColorizerError  naming the colorizer and what was wrong.
  [[nodiscard]] virtual ChromaBatch colorize(const LightnessBatch& patches) = 0;

  /// For logs and metadata: "reference:IMG_1.jpg", "exec:python3 ct2.py".
  [[nodiscard]] virtual std::string name() const = 0;
};

/// What a colorizer is made for, beside the user's options.
struct ColorizerContext {
  std::filesystem::path working_folder;  ///< relative files of the spec are looked up here, then as given
  std::filesystem::path cache_folder;    ///< a fitted reference: network is kept here; empty = refit every time
  std::uint64_t seed = 1;                ///< of the fit of a reference: network
  ProgressSink progress;                 ///< watches that fit; may throw Interrupted
  std::function<void(const std::string&)> say = {};  ///< hears what the user should know; may be empty
};

/// @throws UsageError         an unknown kind or an empty spec; lists the kinds.
/// @throws MissingInputError  a file the spec names does not exist.
/// @throws InputError         a file the spec names cannot be used: not an image, no colour in it.
/// @throws ColorizerError     the back end could not start.
/// @throws DeviceError        the plug-in with the kinds that need LibTorch is missing or cannot be loaded.
[[nodiscard]] std::unique_ptr<Colorizer> make_colorizer(const ColorizerOptions& options,
                                                        const ColorizerContext& context = {});

/// Version of the LibTorch that colorizers use. Loads it.  @throws DeviceError  as make_colorizer.
[[nodiscard]] std::string torch_version();
/// What runs onnx: networks: "ONNX Runtime 1.21.0" or "OpenCV".  @throws DeviceError  when its plug-in cannot be loaded
[[nodiscard]] std::string onnx_engine();

/// Checks shape, size and finiteness of an answer.  @throws ColorizerError  naming the colorizer.
void check_answer(const std::string& colorizer, const LightnessBatch& question, const ChromaBatch& answer);

/// At which a colorizer's distribution becomes one colour: annealed mean, Zhang et al. 2016, Sec. 2.3.
inline constexpr float kAnswerTemperature = 0.38f;

/// The ab image of entry `index` of an answer; a distribution is decoded at kAnswerTemperature.  [2, H, W]
[[nodiscard]] std::vector<float> ab_of(const ChromaBatch& answer, int index);

/// How sure the colorizer is of entry `index`: exp(sum p ln p) of its distribution p, which is one over its perplexity,
/// the number of equally likely colours; in (0, 1]. Empty where the answer does not say.  [H, W]
[[nodiscard]] std::vector<float> certainty_of(const ChromaBatch& answer, int index);

}  // namespace cnerf
