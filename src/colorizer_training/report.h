#pragma once
/// From a trained network to weights that are shipped: choice of the decoding, scores, pictures.

#include <filesystem>
#include <string>
#include <vector>

#include "src/colorizer_training/image_set.h"
#include "src/colorizer_training/score.h"

namespace cnerf::colorizer_training {

/// The decoding with the greatest merit on the validation photographs of scenes, all of them together.
[[nodiscard]] DecodingChoice choose_decoding(ColorizerNet& network, const EvaluationSets& validation,
                                             const torch::Tensor& log_weights, const SoftLabelTable& table);

/// Scores of every set, of all photographs held out together, and of the scenes among them.
[[nodiscard]] std::vector<SetScore> score_sets(ColorizerNet& network, const AbDecoding& decoding,
                                               const ImageSet& images, const SoftLabelTable& table);

/// Rows of (grey, answer, truth), a few images of every set, one below the other.
void write_sample_sheet(const std::filesystem::path& file, ColorizerNet& network, const AbDecoding& decoding,
                        const EvaluationSets& sets, int images_per_set, torch::Device device);

/// One line for the log: merit, AuCs and RMSE of all validation photographs and of the scenes.
[[nodiscard]] std::string validation_line(ColorizerNet& network, const EvaluationSets& validation,
                                          const SoftLabelTable& table);

/// Time the whole way from lightness to ab takes for a 128x128 patch in a batch of 8, the least of many tries.
[[nodiscard]] double patch_milliseconds(ColorizerNet& network, const AbDecoding& decoding, torch::Device device);

}  // namespace cnerf::colorizer_training
