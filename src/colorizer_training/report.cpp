#include "src/colorizer_training/report.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <limits>

#include "src/colorizer/torch/lab_tensors.h"
#include "src/colorizer_training/batch.h"
#include "src/colorizer_training/image_set.h"
#include "src/picture/contact_sheet.h"
#include "src/picture/encode.h"

namespace cnerf::colorizer_training {
using torch::Tensor;

namespace {

constexpr const char* kSceneSets[] = {"bsds500", "cid22", "imagenet1000"};  // whole scenes, not single things
constexpr std::size_t kMostTiles = 1000;  // enlarged 64-pixel images; more would only take time

std::vector<Picture> photographs(const EvaluationSets& sets, bool scenes_only) {
  std::vector<Picture> all;
  for (const auto& [name, images] : sets) {
    const bool scene = std::find(std::begin(kSceneSets), std::end(kSceneSets), name) != std::end(kSceneSets);
    if (name != kTileSet && (scene || !scenes_only)) all.insert(all.end(), images.begin(), images.end());
  }
  return all;
}

SetScore score_set(const std::string& name, const std::vector<Picture>& images, ColorizerNet& network,
                   const AbDecoding& decoding, const SoftLabelTable& table) {
  const std::vector<ChromaScore> scores = score_network(network, images, {{0, decoding}}, {}, table);
  return {name, int(images.size()), scores[0], score_baselines(images, table)};
}

}  // namespace

DecodingChoice choose_decoding(ColorizerNet& network, const EvaluationSets& validation, const Tensor& log_weights,
                               const SoftLabelTable& table) {
  std::vector<DecodingChoice> choices;
  for (const int short_side : {192, 224, 256, 288, 320}) {
    for (const double share : {0.0, 0.15, 0.3, 0.45, 0.6}) {
      for (const double temperature : {1.0, 0.8}) {
        for (const double gain : {0.9, 1.0, 1.15, 1.3, 1.5})
          choices.push_back({share, {temperature, gain, short_side}});
      }
    }
  }
  // Scenes: the large sets of single things have near duplicates among the training images.
  std::vector<Picture> images = photographs(validation, true);
  if (images.empty()) images = photographs(validation, false);
  if (images.empty()) return {};
  const ChromaScore grey = score_baselines(images, table).grey;
  const std::vector<ChromaScore> scores = score_network(network, images, choices, log_weights, table);
  std::size_t best = 0;
  for (std::size_t i = 0; i < choices.size(); ++i) {
    if (merit(scores[i], grey) > merit(scores[best], grey)) best = i;
    std::printf(
        "decoding: side %d share %.2f temperature %.2f gain %.2f: raw %+.2f balanced %+.2f rmse %.3f merit %.2f\n",
        choices[i].decoding.short_side, choices[i].prior_share, choices[i].decoding.temperature,
        choices[i].decoding.gain, scores[i].raw_auc - grey.raw_auc, scores[i].balanced_auc - grey.balanced_auc,
        scores[i].rmse / grey.rmse, merit(scores[i], grey));
  }
  return choices[best];
}

std::vector<SetScore> score_sets(ColorizerNet& network, const AbDecoding& decoding, const ImageSet& images,
                                 const SoftLabelTable& table) {
  std::vector<SetScore> scores;
  const auto score = [&](const std::string& name, const std::vector<Picture>& pictures) {
    scores.push_back(score_set(name, pictures, network, decoding, table));
  };
  for (const auto& [name, pictures] : images.validation) {
    score(name, {pictures.begin(), pictures.begin() + std::ptrdiff_t(std::min(pictures.size(), kMostTiles))});
  }
  if (images.validation.size() > 2) {
    score("all photographs held out", photographs(images.validation, false));
    score("scenes held out", photographs(images.validation, true));
  }
  for (const auto& [name, pictures] : images.evaluation) score(name, pictures);
  return scores;
}

void write_sample_sheet(const std::filesystem::path& file, ColorizerNet& network, const AbDecoding& decoding,
                        const EvaluationSets& sets, int images_per_set, torch::Device device) {
  const torch::NoGradGuard no_grad;
  std::vector<Tile> tiles;
  for (const auto& [name, images] : sets) {
    for (std::size_t i = 0; i < std::min(images.size(), std::size_t(images_per_set)); ++i) {
      const Picture& truth = images[i * images.size() / std::size_t(images_per_set)];
      const Tensor bytes = torch::tensor(torch::ArrayRef<std::uint8_t>(truth.rgb), torch::kUInt8);
      const Tensor srgb =
          bytes.view({1, truth.height, truth.width, 3}).permute({0, 3, 1, 2}).to(device, torch::kFloat32) / 255;
      const Tensor lightness = lab_from_srgb(srgb).lightness;
      const Tensor ab = colorize_lightness(network, lightness, decoding);
      tiles.push_back({picture_from_lab(lightness[0], torch::zeros_like(ab[0])), ""});
      tiles.push_back({picture_from_lab(lightness[0], ab[0]), ""});
      tiles.push_back({truth, name});
    }
  }
  if (!tiles.empty()) write_png(file, tiled(tiles, 3));
}

std::string validation_line(ColorizerNet& network, const EvaluationSets& validation, const SoftLabelTable& table) {
  std::string text;
  for (const bool scenes : {false, true}) {
    const std::vector<Picture> images = photographs(validation, scenes);
    if (images.empty()) continue;
    const ChromaScore grey = score_baselines(images, table).grey;
    const ChromaScore score = score_network(network, images, {DecodingChoice{}}, {}, table)[0];
    char line[200];
    std::snprintf(line, sizeof line, "%s raw %+.2f balanced %+.2f rmse %.3f merit %.2f",
                  scenes ? " | scenes" : "photographs", score.raw_auc - grey.raw_auc,
                  score.balanced_auc - grey.balanced_auc, score.rmse / grey.rmse, merit(score, grey));
    text += line;
  }
  return text;
}

double patch_milliseconds(ColorizerNet& network, const AbDecoding& decoding, torch::Device device) {
  constexpr int kBatch = 8, kTries = 40;
  const torch::NoGradGuard no_grad;
  const Tensor lightness = 100 * torch::rand({kBatch, 1, 128, 128}, device);
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kTries; ++i) {
    const auto start = std::chrono::steady_clock::now();
    (void)colorize_lightness(network, lightness, decoding).cpu();
    const std::chrono::duration<double, std::milli> taken = std::chrono::steady_clock::now() - start;
    least = std::min(least, taken.count() / kBatch);
  }
  return least;
}

}  // namespace cnerf::colorizer_training
