#include "src/prepare/camera_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/calib3d.hpp>

#include "src/base/check.h"
#include "src/base/statistics.h"

namespace cnerf::prepare {
namespace {

constexpr double kStillBelow = 0.005;  ///< of the diagonal
constexpr double kWithin = 1.0 / 250;  ///< of the diagonal
constexpr double kLeastWithin = 2;     ///< pixels: as far as places drift when they are followed
constexpr double kExplained = 0.85;    ///< of all places; the rest may be wrong or move by themselves

constexpr double kWorthATry = 0.5;  ///< of all places within one homography, which random picks find roughly

/// Focal lengths in diagonals: from a very wide lens to a long one.
constexpr double kShortest = 0.35, kLongest = 6;

cv::Vec3d bearing(cv::Point2f pixel, cv::Size picture, double focal) {
  const cv::Vec3d v((pixel.x - 0.5 * picture.width) / focal, (pixel.y - 0.5 * picture.height) / focal, 1);
  return v / cv::norm(v);
}

struct Turn {
  double focal_before = 0, focal_after = 0;  ///< pixels
  cv::Matx33d rotation;
};

/// The rotation that brings bearings of the first picture nearest to those of the second (Kabsch), focal lengths given.
Turn fit_rotation(const std::vector<cv::Point2f>& before, const std::vector<cv::Point2f>& after, cv::Size picture,
                  double focal_before, double focal_after) {
  cv::Matx33d sum = cv::Matx33d::zeros();
  for (std::size_t i = 0; i < before.size(); ++i) {
    sum += bearing(after[i], picture, focal_after) * bearing(before[i], picture, focal_before).t();
  }
  cv::Matx31d singular;
  cv::Matx33d u, vt;
  cv::SVD::compute(sum, singular, u, vt);
  const double handed = cv::determinant(u * vt) < 0 ? -1 : 1;
  return {focal_before, focal_after, u * cv::Matx33d(1, 0, 0, 0, 1, 0, 0, 0, handed) * vt};
}

std::vector<double> errors_of(const Turn& turn, const std::vector<cv::Point2f>& before,
                              const std::vector<cv::Point2f>& after, cv::Size picture) {
  std::vector<double> errors;
  for (std::size_t i = 0; i < before.size(); ++i) {
    const cv::Vec3d v = turn.rotation * bearing(before[i], picture, turn.focal_before);
    if (v[2] <= 1e-6) {
      errors.push_back(1e9);
      continue;
    }
    const double x = v[0] / v[2] * turn.focal_after + 0.5 * picture.width;
    const double y = v[1] / v[2] * turn.focal_after + 0.5 * picture.height;
    errors.push_back(std::hypot(x - after[i].x, y - after[i].y));
  }
  return errors;
}

double share_below(const std::vector<double>& errors, double limit) {
  return double(std::ranges::count_if(errors, [&](double e) { return e < limit; })) / double(errors.size());
}

/// At most `count` of them, evenly picked.
std::vector<cv::Point2f> some_of(const std::vector<cv::Point2f>& points, std::size_t count) {
  std::vector<cv::Point2f> out;
  const std::size_t step = (points.size() + count - 1) / count;
  for (std::size_t i = 0; i < points.size(); i += step) out.push_back(points[i]);
  return out;
}

struct Least {
  double cost = 1e30, at = 0;
};

/// The least of `cost` in [low, high]: 13 places, then five around the best, ever closer.
template <typename Cost>
Least search(double low, double high, int rounds, Cost&& cost) {
  Least least = {1e30, 0.5 * (low + high)};
  int reach = 6;
  double step = (high - low) / (2 * reach);
  for (int round = 0; round < rounds; ++round, reach = 2, step /= 2.5) {
    const double middle = least.at;
    for (int i = -reach; i <= reach; ++i) {
      const double at = middle + step * i;
      if (const double value = cost(at); value < least.cost) least = {value, at};
    }
  }
  return least;
}

/// The focal lengths and rotation of the least mean error. The zoom is searched for each focal length anew: the two
/// trade against each other, so a search over both at once stays where it first looked.
Turn best_turn(const std::vector<cv::Point2f>& all_before, const std::vector<cv::Point2f>& all_after, cv::Size picture,
               double diagonal) {
  const auto before = some_of(all_before, 60), after = some_of(all_after, 60);
  const auto turn_of = [&](double log_focal, double log_zoom) {
    return fit_rotation(before, after, picture, diagonal * std::exp(log_focal),
                        diagonal * std::exp(log_focal + log_zoom));
  };
  const auto best_zoom = [&](double log_focal) {
    return search(-std::log(1.6), std::log(1.6), 6, [&](double log_zoom) {
      double sum = 0;
      for (const double error : errors_of(turn_of(log_focal, log_zoom), before, after, picture)) {
        sum += std::min(error, 0.1 * diagonal);
      }
      return sum;
    });
  };
  const Least focal =
      search(std::log(kShortest), std::log(kLongest), 5, [&](double log_focal) { return best_zoom(log_focal).cost; });
  return turn_of(focal.at, best_zoom(focal.at).at);
}

}  // namespace

MotionVerdict judge_motion(const std::vector<cv::Point2f>& before, const std::vector<cv::Point2f>& after,
                           cv::Size picture) {
  CNERF_CHECK_EQ(before.size(), after.size());
  CNERF_CHECK(before.size() >= 12, "a motion is judged by 12 places at least");
  const double diagonal = std::hypot(picture.width, picture.height);
  const double within = std::max(kLeastWithin, kWithin * diagonal);
  MotionVerdict out;
  std::vector<double> moves;
  for (std::size_t i = 0; i < before.size(); ++i) moves.push_back(cv::norm(after[i] - before[i]));
  out.moved = median(moves) / diagonal;
  if (out.moved < kStillBelow) return out;

  // Places that one homography explains: a turn is a homography, so wrong and moving places fall out here.
  cv::Mat inlier;
  const cv::Mat homography = cv::findHomography(before, after, cv::RANSAC, within, inlier);
  std::vector<cv::Point2f> kept_before, kept_after;
  for (int i = 0; !homography.empty() && i < inlier.rows; ++i) {
    if (inlier.at<std::uint8_t>(i) == 0) continue;
    kept_before.push_back(before[std::size_t(i)]);
    kept_after.push_back(after[std::size_t(i)]);
  }
  out.motion = Motion::kParallax;
  if (double(kept_before.size()) < kWorthATry * double(before.size())) return out;
  const Turn turn = best_turn(kept_before, kept_after, picture, diagonal);
  out.explained = share_below(errors_of(turn, before, after, picture), within);
  if (out.explained >= kExplained) out.motion = Motion::kTurned;
  return out;
}

}  // namespace cnerf::prepare
