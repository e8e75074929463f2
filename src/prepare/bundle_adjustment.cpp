#include "src/prepare/bundle_adjustment.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <glog/logging.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "src/base/aabb.h"
#include "src/base/error.h"
#include "src/base/statistics.h"
#include "src/capture/camera_math.h"
#include "src/prepare/feature_tracks.h"
#include "src/prepare/sparse_points.h"
#include "src/render/training_views.h"
#include "src/train/luminance/learned_views.h"

namespace cnerf::prepare {
namespace {

// Coarse to fine: cameras that are far off find few points within a narrow tolerance.
constexpr std::array kTolerances = {16.0, 4.0};  // pixels
constexpr double kOutlier = 1;                   // pixels: what is further off pulls less and less
constexpr std::size_t kFewestPoints = 100;       // of a capture
// Of the F statistic. Cameras that are right have 1 to 5, more than 1 where features say the same twice; half a degree
// or a focal length 3 % off has hundreds (docs/evaluation.md).
constexpr double kLeastEvidence = 8;

// How far things are expected to be off. Next to thousands of features this says nothing, but for what features do not
// say: where all cameras together stand, and the focal length of views that look alike.
constexpr std::array<double, 6> kPoseSpread = {0.02, 0.02, 0.02, 0.02, 0.02, 0.02};  // radians, sizes of the scene
constexpr std::array<double, 3> kLensSpread = {0.05, 0.1, 0.1};

/// The turn, a rotation vector that follows the camera's own, world axes; the shift, in sizes of the scene.
using PoseNumbers = std::array<double, 6>;
/// ln of the focal length's factor; k1 and k2, added. Principal points and tangential distortion stay: turned cameras
/// look much the same.
using LensNumbers = std::array<double, 3>;

/// Where a lens with these numbers shows a point, in focal lengths as given; nothing behind the camera.
template <typename Real>
std::optional<lens::PlanePointOf<Real>> shown_at(const Intrinsics& given, const Real* numbers, const Real* point) {
  if (!(point[2] > 0.0)) return std::nullopt;
  std::array<Real, 8> c;
  for (std::size_t i = 0; i < c.size(); ++i) c[i] = Real(given.distortion[i]);
  const Real focal = exp(numbers[0]);
  lens::PlanePointOf<Real> at{point[0] / point[2], point[1] / point[2]};
  if (given.model == LensModel::kOpenCvFisheye) {
    const Real across = sqrt(at.x * at.x + at.y * at.y + 1e-24);
    const Real scale = lens::fisheye_distance(c, Real(atan(across))) / across;
    return lens::PlanePointOf<Real>{focal * scale * at.x, focal * scale * at.y};
  }
  c[0] += numbers[1];
  c[1] += numbers[2];
  at = lens::distorted(c, at, lens::radial_factor(c, Real(at.x * at.x + at.y * at.y)));
  return lens::PlanePointOf<Real>{focal * at.x, focal * at.y};
}

/// How far a point is from where a view shows it, pixels.
struct Reprojection {
  Intrinsics lens_given;
  Affined pose_given;
  PixelPosition pixel;
  double pixel_per_own, size;

  template <typename Real>
  bool operator()(const Real* pose, const Real* lens, const Real* point, Real* off) const {
    const Vec3d& centre = pose_given.translation;
    const Real back[3] = {-pose[0], -pose[1], -pose[2]};
    const Real arm[3] = {point[0] - centre.x - size * pose[3], point[1] - centre.y - size * pose[4],
                         point[2] - centre.z - size * pose[5]};
    Real turned_arm[3], in_camera[3];
    ceres::AngleAxisRotatePoint(back, arm, turned_arm);
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3d along = pose_given.linear.column(axis);
      in_camera[axis] = along.x * turned_arm[0] + along.y * turned_arm[1] + along.z * turned_arm[2];
    }
    const auto at = shown_at(lens_given, lens, in_camera);
    if (!at) return false;
    off[0] = (at->x * lens_given.fx + lens_given.cx - pixel.x) * pixel_per_own;
    off[1] = (at->y * lens_given.fy + lens_given.cy - pixel.y) * pixel_per_own;
    return true;
  }
};

template <std::size_t N>
struct Expectation {
  std::array<double, N> spread;
  template <typename Number>
  bool operator()(const Number* numbers, Number* off) const {
    for (std::size_t i = 0; i < N; ++i) off[i] = numbers[i] / spread[i];
    return true;
  }
};

/// Of a camera or lens that the problem knows.
template <std::size_t N>
void expect(ceres::Problem& problem, const std::array<double, N>& spread, std::array<double, N>& numbers,
            bool is_adjusted) {
  using Cost = ceres::AutoDiffCostFunction<Expectation<N>, int(N), int(N)>;
  if (!problem.HasParameterBlock(numbers.data())) return;
  problem.AddResidualBlock(new Cost(new Expectation<N>{spread}), nullptr, numbers.data());
  if (!is_adjusted) problem.SetParameterBlockConstant(numbers.data());
}

/// Cancels when the observer does.
class Listener final : public ceres::IterationCallback {
 public:
  explicit Listener(Observer& observer) : observer_(observer) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    return observer_.is_cancelled() ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }

 private:
  Observer& observer_;
};

double size_of(const Capture& capture) {
  Aabbd box = Aabbd::empty();
  for (const View& view : capture.views) {
    if (!view.held_out) box.grow(view.world_from_camera.translation);
  }
  return length(box.size());
}

/// Measures the tracks' errors anew.  @return  their median
double measure(std::vector<Track>& tracks, const FeatureTracks& features, const Capture& capture) {
  std::vector<double> errors;
  for (Track& track : tracks) errors.push_back(track.error = features.error_of(track, capture));
  return median(errors);
}

/// The numbers of all cameras, and how they were given.
class Adjuster {
 public:
  Adjuster(const Capture& capture, const FeatureTracks& features, const Stage1Options& options)
      : features_(features),
        adjusts_poses_(options.poses),
        adjusts_lenses_(options.lenses),
        size_(size_of(capture)),
        given_lenses_(lenses_of(capture)),
        pose_numbers_(capture.views.size()),
        lens_numbers_(given_lenses_.size()) {
    for (const View& view : capture.views) given_.push_back({view.intrinsics, view.world_from_camera});
  }

  struct Fit {
    double cost = 0, residuals = 0, parameters = 0;
  };

  /// Fits the numbers to the tracks, whose points it moves.
  Fit fit_to(std::vector<Track>& tracks, Observer& observer) {
    std::vector<std::array<double, 3>> points;
    for (const Track& track : tracks) points.push_back({track.position.x, track.position.y, track.position.z});
    ceres::Problem problem;
    for (std::size_t t = 0; t < tracks.size(); ++t) {
      for (const Track::Sighting& sighting : tracks[t].sightings) add(sighting, points[t], problem);
    }
    for (PoseNumbers& numbers : pose_numbers_) expect(problem, kPoseSpread, numbers, adjusts_poses_);
    for (LensNumbers& numbers : lens_numbers_) expect(problem, kLensSpread, numbers, adjusts_lenses_);
    const ceres::Solver::Summary summary = solve(problem, observer);
    for (std::size_t t = 0; t < tracks.size(); ++t) tracks[t].position = {points[t][0], points[t][1], points[t][2]};
    return {summary.final_cost, double(summary.num_residuals_reduced),
            double(summary.num_effective_parameters_reduced)};
  }

  /// The numbers as stage 1 has them.
  [[nodiscard]] LearnedViews moves(const Capture& capture) const {
    LearnedViews moved{{{}, 1, 1}, {}, {}};
    for (std::size_t v = 0; v < capture.views.size(); ++v) {
      const PoseNumbers& n = pose_numbers_[v];
      if (capture.views[v].held_out) continue;
      const Vec3d turn{n[0], n[1], n[2]}, shift = size_ * Vec3d{n[3], n[4], n[5]};
      moved.corrections.push_back({0, turn.cast<float>(), shift.cast<float>()});
    }
    for (const LensNumbers& n : lens_numbers_) {
      if (adjusts_lenses_) moved.lenses.push_back({.log_focal = float(n[0]), .k1 = float(n[1]), .k2 = float(n[2])});
    }
    return moved;
  }

  /// Puts the capture's cameras where they are by now.
  void apply_to(Capture& capture) const {
    for (std::size_t v = 0; v < given_.size(); ++v) {
      std::tie(capture.views[v].intrinsics, capture.views[v].world_from_camera) = given_[v];
    }
    apply_learned_views(capture, moves(capture));
  }

 private:
  void add(const Track::Sighting& sighting, std::array<double, 3>& point, ceres::Problem& problem) {
    const auto& [intrinsics, pose] = given_[sighting.view];
    const auto lens = std::size_t(std::ranges::find(given_lenses_, intrinsics) - given_lenses_.begin());
    using Cost = ceres::AutoDiffCostFunction<Reprojection, 2, 6, 3, 3>;
    auto* cost = new Cost(
        new Reprojection{intrinsics, pose, sighting.pixel, features_.of_view(sighting.view).pixel_per_own, size_});
    problem.AddResidualBlock(cost, new ceres::CauchyLoss(kOutlier), pose_numbers_[sighting.view].data(),
                             lens_numbers_[lens].data(), point.data());
  }

  static ceres::Solver::Summary solve(ceres::Problem& problem, Observer& observer) {
    Listener listener(observer);
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::SPARSE_SCHUR;
    options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;  // whose sums no other threads share
    options.max_num_iterations = 30;
    options.function_tolerance = 1e-4;
    options.num_threads = 1;  // sums of several come out differently each time
    options.logging_type = ceres::SILENT;
    options.callbacks.push_back(&listener);
    FLAGS_minloglevel = google::GLOG_FATAL;  // steps that fail are no news for the terminal
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    if (observer.is_cancelled()) throw Interrupted("stopped while adjusting cameras");
    return summary;
  }

  const FeatureTracks& features_;
  bool adjusts_poses_, adjusts_lenses_;
  double size_;
  std::vector<Intrinsics> given_lenses_;
  std::vector<std::pair<Intrinsics, Affined>> given_;  // of all views
  std::vector<PoseNumbers> pose_numbers_;
  std::vector<LensNumbers> lens_numbers_;
};

}  // namespace

bool adjusts_cameras(const Capture& capture, const Stage1Options& options) {
  return (options.poses || options.lenses) && !has_seen_points(capture);
}

AdjustedCameras adjust_cameras(Capture& capture, const Stage1Options& options, Observer& observer) {
  const FeatureTracks features(capture, observer);
  Adjuster adjuster(capture, features, options);
  Adjuster still(capture, features, Stage1Options{});  // moves points alone
  std::vector<Track> tracks;
  Adjuster::Fit moved;
  for (const double tolerance : kTolerances) {
    tracks = features.triangulated(capture, tolerance, observer);
    if (tracks.size() < kFewestPoints) {
      still.apply_to(capture);
      return {};
    }
    moved = adjuster.fit_to(tracks, observer);
    adjuster.apply_to(capture);
  }
  AdjustedCameras found;
  found.error_after = measure(tracks, features, capture);
  std::vector<Track> as_given = tracks;
  const Adjuster::Fit given = still.fit_to(as_given, observer);
  still.apply_to(capture);
  found.error_before = measure(as_given, features, capture);
  found.evidence = (given.cost - moved.cost) / (moved.parameters - given.parameters) /
                   (moved.cost / (moved.residuals - moved.parameters));
  if (found.evidence >= kLeastEvidence) {
    adjuster.apply_to(capture);
    found.moved = adjuster.moves(capture);
  } else {
    tracks = std::move(as_given);
  }
  for (const Track& track : tracks) {
    if (!capture.is_bounded_object) found.points.push_back(point_of(track));
  }
  return found;
}

}  // namespace cnerf::prepare
