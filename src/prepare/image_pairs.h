#pragma once
/// Selection of image pairs to match where there are too many for all of them: neighbours in order, and pairs that look
/// alike. COLMAP's own retrieval
/// needs a vocabulary file that it would have to download.

#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

namespace cnerf::prepare {

/// What a picture looks like from afar: histograms of gradient directions on a 4 x 4 grid, of length 1.
using LookVector = std::vector<float>;
[[nodiscard]] LookVector look_of(const cv::Mat1b& picture);

struct PairOptions {
  int neighbours = 0;  ///< on each side in the order of the images; and at distances 16, 32, 64, …
  int alike = 0;       ///< per image, by look
};

/// Pairs (i, j), i < j, each once, sorted.
[[nodiscard]] std::vector<std::pair<int, int>> choose_pairs(const std::vector<LookVector>& looks,
                                                            const PairOptions& options);

}  // namespace cnerf::prepare
