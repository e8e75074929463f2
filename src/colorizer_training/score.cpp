#include "src/colorizer_training/score.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <map>

#include "src/color/ab_bins.h"
#include "src/colorizer/torch/lab_tensors.h"

namespace cnerf::colorizer_training {
using torch::Tensor;

namespace {

constexpr std::int64_t kThresholds = 150;
constexpr std::size_t kImagesPerPass = 16;

/// Calls `visit(lightness [B,1,H,W], ab [B,2,H,W])` over batches of images of one size.
template <typename Visit>
void for_each_batch(const std::vector<Picture>& images, torch::Device device, const Visit& visit) {
  std::map<std::pair<int, int>, std::vector<const Picture*>> by_size;
  for (const Picture& image : images) by_size[{image.width, image.height}].push_back(&image);
  for (const auto& [size, group] : by_size) {
    for (std::size_t first = 0; first < group.size(); first += kImagesPerPass) {
      const std::size_t count = std::min(kImagesPerPass, group.size() - first);
      Tensor bytes = torch::empty({std::int64_t(count), size.second, size.first, 3}, torch::kUInt8);
      for (std::size_t i = 0; i < count; ++i) {
        const auto& rgb = group[first + i]->rgb;
        std::memcpy(bytes.data_ptr<std::uint8_t>() + i * rgb.size(), rgb.data(), rgb.size());
      }
      const LabPlanes lab = lab_from_srgb(bytes.to(device).permute({0, 3, 1, 2}).to(torch::kFloat32) / 255);
      visit(lab.lightness, lab.ab);
    }
  }
}

/// Hasler and Suesstrunk's M of every image, on 8-bit values.  [B]
Tensor colorfulness_of(const Tensor& lightness, const Tensor& ab) {
  const Tensor rgb = (srgb_from_lab(lightness, ab) * 255).round();
  const Tensor r = rgb.select(1, 0).flatten(1), g = rgb.select(1, 1).flatten(1), b = rgb.select(1, 2).flatten(1);
  const Tensor rg = r - g, yb = 0.5 * (r + g) - b;
  const auto variance = [](const Tensor& x) { return x.square().mean(1) - x.mean(1).square(); };
  const Tensor spread = (variance(rg) + variance(yb)).clamp_min(0).sqrt();
  return spread + 0.3 * (rg.mean(1).square() + yb.mean(1).square()).sqrt();
}

/// AuC from [.., kThresholds + 2] pixels by rounded-up error: thresholds 0..150, each equally weighted.
Tensor area_under_curve(const Tensor& histogram) {
  const Tensor total = histogram.sum(-1, true).clamp_min(1e-12);
  return 100 * (histogram / total).cumsum(-1).slice(-1, 0, kThresholds + 1).mean(-1);
}

struct AucPair {
  double raw, balanced;
};

/// @param histogram  [313, kThresholds + 2]; the last column holds errors above every threshold.
AucPair auc_of(const Tensor& histogram) {
  const Tensor present = histogram.sum(1) > 0;
  return {area_under_curve(histogram.sum(0)).item<double>(),
          area_under_curve(histogram).masked_select(present).mean().item<double>()};
}

Tensor error_column(const Tensor& distance) {
  return distance.ceil().clamp_max(double(kThresholds + 1)).to(torch::kInt64);
}

constexpr int kGridLimit = 110, kGridSide = 2 * kGridLimit + 1;

/// True colours of all pixels, counted on a grid of one ab unit.  [kGridSide^2] f64
Tensor color_histogram(const std::vector<Picture>& images, torch::Device device) {
  Tensor counts = torch::zeros({kGridSide * kGridSide}, torch::TensorOptions(torch::kFloat64).device(device));
  for_each_batch(images, device, [&](const Tensor&, const Tensor& ab) {
    const Tensor cell = (ab.round().clamp(-kGridLimit, kGridLimit) + kGridLimit).to(torch::kInt64);
    const Tensor index = (cell.select(1, 0) * kGridSide + cell.select(1, 1)).flatten();
    counts += torch::bincount(index, {}, kGridSide * kGridSide);
  });
  return counts.cpu();
}

/// The colours that occur.
struct ColorCounts {
  Tensor counts;  ///< [N] f64 pixels
  Tensor grid;    ///< [N, 2] f32 ab
  Tensor bins;    ///< [N] i64
};
ColorCounts count_colors(const std::vector<Picture>& images, const SoftLabelTable& table) {
  const Tensor all = color_histogram(images, table.device());
  const Tensor used = (all > 0).nonzero().squeeze(1);
  const Tensor grid =
      torch::stack({used.div(kGridSide, "floor") - kGridLimit, used.remainder(kGridSide) - kGridLimit}, 1)
          .to(torch::kFloat32);
  const Tensor bins = table.look_up(grid.t().view({1, 2, -1, 1}).to(table.device())).bin.select(1, 0).cpu();
  return {all.index_select(0, used), grid, bins};
}

/// Score of one colour for all the pixels counted on the grid.
ChromaScore score_constant(const ColorCounts& colors, Ab color) {
  const Tensor& counts = colors.counts;
  const Tensor distance = (colors.grid - torch::tensor({color.a, color.b})).square().sum(1).sqrt();
  const Tensor index = colors.bins * (kThresholds + 2) + error_column(distance);
  const Tensor histogram =
      torch::bincount(index, counts, kAbBinCount * (kThresholds + 2)).view({kAbBinCount, kThresholds + 2});
  const AucPair auc = auc_of(histogram);
  return {auc.raw, auc.balanced, std::sqrt(((distance.square() * counts).sum() / (2 * counts.sum())).item<double>()), 0,
          0};
}

/// Collects errors of one set of images.
class ChromaScorer {
 public:
  explicit ChromaScorer(const SoftLabelTable& table) : table_(table) {
    const auto options = torch::TensorOptions(torch::kFloat64).device(table.device());
    histogram_ = torch::zeros({kAbBinCount * (kThresholds + 2)}, options);
    squared_ = torch::zeros({}, options);
    colorfulness_ = torch::zeros({}, options);
    true_colorfulness_ = torch::zeros({}, options);
  }
  /// @param truth, answer  [B, 2, H, W] ab   @param lightness  [B, 1, H, W]
  void add(const Tensor& truth, const Tensor& answer, const Tensor& lightness) {
    const Tensor distance = (answer - truth).square().sum(1).sqrt().flatten();
    const Tensor index = table_.look_up(truth).bin.select(1, 0) * (kThresholds + 2) + error_column(distance);
    histogram_ += torch::bincount(index, {}, kAbBinCount * (kThresholds + 2));
    squared_ += distance.to(torch::kFloat64).square().sum();
    pixels_ += double(distance.numel());
    images_ += double(truth.size(0));
    colorfulness_ += colorfulness_of(lightness, answer).sum();
    true_colorfulness_ += colorfulness_of(lightness, truth).sum();
  }
  [[nodiscard]] ChromaScore score() const {
    const AucPair auc = auc_of(histogram_.cpu().view({kAbBinCount, kThresholds + 2}));
    return {auc.raw, auc.balanced, std::sqrt(squared_.item<double>() / (2 * pixels_)),
            colorfulness_.item<double>() / images_, true_colorfulness_.item<double>() / images_};
  }

 private:
  const SoftLabelTable& table_;
  Tensor histogram_;  // [313 * 152] f64: pixels by true bin and by error
  Tensor squared_;    // f64 sum
  double pixels_ = 0, images_ = 0;
  Tensor colorfulness_, true_colorfulness_;
};

}  // namespace

std::vector<ChromaScore> score_network(ColorizerNet& network, const std::vector<Picture>& images,
                                       const std::vector<DecodingChoice>& choices, const Tensor& log_weights,
                                       const SoftLabelTable& table) {
  const torch::NoGradGuard no_grad;
  std::vector<ChromaScorer> scorers;
  for (std::size_t i = 0; i < choices.size(); ++i) scorers.emplace_back(table);
  for_each_batch(images, table.device(), [&](const Tensor& lightness, const Tensor& ab) {
    std::map<int, Tensor> logits;  // by the short side asked at
    for (std::size_t i = 0; i < choices.size(); ++i) {
      const auto& [prior_share, decoding] = choices[i];
      Tensor& answer = logits[decoding.short_side];
      if (!answer.defined()) answer = ask_network(network, lightness, decoding.short_side);
      const Tensor shifted = prior_share == 0 ? answer : answer - prior_share * log_weights.view({1, -1, 1, 1});
      scorers[i].add(ab, read_answer(shifted, lightness, decoding), lightness);
    }
  });
  std::vector<ChromaScore> scores;
  for (const auto& scorer : scorers) scores.push_back(scorer.score());
  return scores;
}

Baselines score_baselines(const std::vector<Picture>& images, const SoftLabelTable& table) {
  const torch::NoGradGuard no_grad;
  const ColorCounts colors = count_colors(images, table);
  Baselines baselines{score_constant(colors, {0, 0}), {}};
  ChromaScore& best = baselines.best_constant;
  best = baselines.grey;
  for (const Ab& centre : ab_bin_centres()) {
    const ChromaScore score = score_constant(colors, centre);
    best.raw_auc = std::max(best.raw_auc, score.raw_auc);
    best.balanced_auc = std::max(best.balanced_auc, score.balanced_auc);
    best.rmse = std::min(best.rmse, score.rmse);
  }
  return baselines;
}

double merit(const ChromaScore& network, const ChromaScore& grey) {
  constexpr double kRmseShare = 0.82, kRawGain = 1.5;
  return network.balanced_auc - grey.balanced_auc - 100 * std::max(0.0, network.rmse / grey.rmse - kRmseShare) -
         2 * std::max(0.0, kRawGain - (network.raw_auc - grey.raw_auc));
}

std::string score_table(const std::vector<SetScore>& sets) {
  std::string table =
      "| set | images | answer | raw AuC | balanced AuC | ab-RMSE | share of grey's RMSE | colourfulness ratio |\n"
      "|---|---|---|---|---|---|---|---|\n";
  const auto row = [&](const SetScore& set, const char* answer, const ChromaScore& score, double ratio) {
    char line[256];
    std::snprintf(line, sizeof line, "| %s | %d | %s | %.2f | %.2f | %.2f | %.3f | %.2f |\n", set.name.c_str(),
                  set.images, answer, score.raw_auc, score.balanced_auc, score.rmse,
                  score.rmse / set.baselines.grey.rmse, ratio);
    table += line;
  };
  for (const SetScore& set : sets) {
    row(set, "all grey", set.baselines.grey, 0);
    row(set, "best constant", set.baselines.best_constant, 0);
    row(set, "**built-in**", set.network, set.network.colorfulness / set.network.true_colorfulness);
  }
  return table;
}

}  // namespace cnerf::colorizer_training
