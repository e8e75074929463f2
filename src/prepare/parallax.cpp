#include "src/prepare/parallax.h"

#include <map>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <set>

#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/capture/image_io.h"
#include "src/prepare/camera_motion.h"
#include "src/prepare/grey_image.h"

namespace cnerf::prepare {
namespace fs = std::filesystem;
namespace {

constexpr int kMatchedSide = 800, kMatchedFeatures = 1500;
constexpr float kMatchRatio = 0.8f;  ///< Lowe's: of the best distance to the second best
constexpr std::size_t kFewestMatches = 40;
constexpr double kAgreement = 2;     ///< pixels
constexpr double kLeastMove = 0.05;  ///< of the diagonal, from which a pair is judged
constexpr std::size_t kStarts = 12;  ///< photographs from which pairs are made
constexpr int kFewestJudged = 4;
constexpr double kTurnedShare = 0.9;

struct Features {
  std::vector<cv::KeyPoint> points;
  cv::Mat descriptors;
  cv::Size picture;
};

Features features_of(const fs::path& file) {
  const LinearImage image = luminance_image(read_linear_image(file, Transfer::kSrgb));
  const cv::Mat1b picture = reduced_to(grey_codes(image), kMatchedSide);
  Features out;
  out.picture = picture.size();
  cv::SIFT::create(kMatchedFeatures)->detectAndCompute(picture, cv::noArray(), out.points, out.descriptors);
  return out;
}

/// The same places in both pictures.
struct Matches {
  std::vector<cv::Point2f> from, to;
};

/// Matches that agree with some motion of the camera. A turn leaves them all, wrong ones mostly fall out.
Matches in_agreement(const Matches& all) {
  std::vector<std::uint8_t> agrees;
  if (all.from.size() < kFewestMatches) return {};
  cv::findFundamentalMat(all.from, all.to, cv::FM_RANSAC, kAgreement, 0.999, agrees);
  Matches out;
  for (std::size_t i = 0; i < agrees.size(); ++i) {
    if (agrees[i] == 0) continue;
    out.from.push_back(all.from[i]);
    out.to.push_back(all.to[i]);
  }
  return out;
}

/// Each the other's best, and clearly so.
Matches match(const Features& a, const Features& b) {
  Matches out;
  if (a.points.size() < 2 || b.points.size() < 2) return out;
  std::vector<std::vector<cv::DMatch>> best;
  std::vector<cv::DMatch> back;
  const cv::BFMatcher matcher(cv::NORM_L2);
  matcher.knnMatch(a.descriptors, b.descriptors, best, 2);
  matcher.match(b.descriptors, a.descriptors, back);
  for (const auto& two : best) {
    if (two[0].distance > kMatchRatio * two[1].distance) continue;
    if (back[std::size_t(two[0].trainIdx)].trainIdx != two[0].queryIdx) continue;
    out.from.push_back(a.points[std::size_t(two[0].queryIdx)].pt);
    out.to.push_back(b.points[std::size_t(two[0].trainIdx)].pt);
  }
  return in_agreement(out);
}

/// Evenly spread starts, each with its neighbour and with photographs further on, where parallax would grow.
std::set<std::pair<std::size_t, std::size_t>> pairs_of(std::size_t count) {
  std::set<std::pair<std::size_t, std::size_t>> pairs;
  const std::size_t starts = std::min(count, kStarts);
  for (std::size_t k = 0; k < starts; ++k) {
    const std::size_t i = k * count / starts;
    for (const std::size_t step : {1, 2, 4}) {
      if (i + step < count) pairs.insert({i, i + step});
    }
  }
  return pairs;
}

}  // namespace

bool ParallaxSurvey::only_turned() const {
  return judged >= kFewestJudged && judged - with_parallax >= kTurnedShare * judged;
}

ParallaxSurvey survey_parallax(const std::vector<PreparedImage>& images, const fs::path& capture) {
  const auto pairs = pairs_of(images.size());
  std::map<std::size_t, Features> features;
  for (const auto& [a, b] : pairs) features[a], features[b];
  std::vector<std::size_t> used;
  for (const auto& [i, none] : features) used.push_back(i);
  parallel_tasks(used.size(), [&](std::size_t k) {
    if (interruption_requested()) return;
    features.at(used[k]) = features_of(capture / "images" / images[used[k]].name);
  });
  if (interruption_requested()) throw Interrupted("stopped while looking for parallax");
  ParallaxSurvey out;
  for (const auto& [a, b] : pairs) {
    if (images[a].width != images[b].width || images[a].height != images[b].height) continue;
    const Matches matches = match(features.at(a), features.at(b));
    if (matches.from.size() < kFewestMatches) continue;
    const MotionVerdict verdict = judge_motion(matches.from, matches.to, features.at(a).picture);
    if (verdict.motion == Motion::kStill || verdict.moved < kLeastMove) continue;
    ++out.judged;
    out.with_parallax += verdict.motion == Motion::kParallax ? 1 : 0;
  }
  return out;
}

}  // namespace cnerf::prepare
