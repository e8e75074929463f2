#include "src/prepare/similarity.h"

#include <gtest/gtest.h>

#include <cmath>

#include "src/base/error.h"
#include "src/base/rng.h"
#include "tests/prepare/random_similarity.h"
#include "tests/support/pose_comparison.h"

namespace cnerf::prepare {
namespace {

constexpr double kExact = 1e-9;  // measured 1e-14; doubles, numbers of order 1 to 100

std::vector<Vec3d> random_points(SequentialRng& rng, int count) {
  std::vector<Vec3d> points;
  for (int i = 0; i < count; ++i) points.push_back(test::random_vector(rng));
  return points;
}

double distance(const Similarity& a, const Similarity& b) {
  double sum = std::abs(a.scale - b.scale) + length(a.translation - b.translation);
  for (int i = 0; i < 3; ++i) sum += length(a.rotation.rows[i] - b.rotation.rows[i]);
  return sum;
}

TEST(Similarity, InverseAndProductCancel) {
  SequentialRng rng(1, 0);
  for (int trial = 0; trial < 50; ++trial) {
    const Similarity s = test::random_similarity(rng);
    EXPECT_LT(distance(s * s.inverse(), Similarity{}), kExact);
    EXPECT_LT(distance(s.inverse() * s, Similarity{}), kExact);
  }
}

TEST(Similarity, PosesMoveAsTheirPointsDo) {
  SequentialRng rng(2, 0);
  const Similarity s = test::random_similarity(rng);
  const Affined pose = {test::random_rotation(rng), test::random_vector(rng)};
  const Vec3d in_camera = test::random_vector(rng);
  // A point the camera sees at `in_camera` is seen at `scale * in_camera` once both have moved.
  EXPECT_LT(length(s.pose(pose).point(s.scale * in_camera) - s.point(pose.point(in_camera))), kExact);
}

TEST(FitSimilarity, FindsWhatMadeThePoints) {
  SequentialRng rng(3, 0);
  for (int trial = 0; trial < 100; ++trial) {
    const Similarity truth = test::random_similarity(rng);
    const std::vector<Vec3d> source = random_points(rng, 3 + trial % 8);
    std::vector<Vec3d> target;
    for (const Vec3d& p : source) target.push_back(truth.point(p));
    EXPECT_LT(distance(test::fit_similarity(source, target), truth), 1e-6)
        << trial;  // measured 5e-9, nearly collinear sets
  }
}

TEST(FitSimilarity, PlanarPointsGiveARotationNotAMirror) {
  SequentialRng rng(4, 0);
  std::vector<Vec3d> source = random_points(rng, 12);
  for (Vec3d& p : source) p.z = 0;
  const Similarity truth = test::random_similarity(rng);
  std::vector<Vec3d> target;
  for (const Vec3d& p : source) target.push_back(truth.point(p));
  const Similarity found = test::fit_similarity(source, target);
  EXPECT_NEAR(found.rotation.determinant(), 1, kExact);
  EXPECT_LT(distance(found, truth), 1e-7);
}

TEST(FitSimilarity, NoNearbySimilarityFitsNoisyPointsBetter) {
  SequentialRng rng(5, 0);
  const std::vector<Vec3d> source = random_points(rng, 20);
  const Similarity truth = test::random_similarity(rng);
  std::vector<Vec3d> target;
  for (const Vec3d& p : source) target.push_back(truth.point(p) + test::random_vector(rng) * 0.3);
  const auto cost = [&](const Similarity& s) {
    double sum = 0;
    for (std::size_t i = 0; i < source.size(); ++i) {
      const Vec3d off = s.point(source[i]) - target[i];
      sum += dot(off, off);
    }
    return sum;
  };
  const Similarity best = test::fit_similarity(source, target);
  for (int trial = 0; trial < 200; ++trial) {
    Similarity other = best;
    const Vec3d axis = normalized(Vec3d{0, 0, 1} + test::random_vector(rng) * 0.01);
    other.rotation = rotation_between({0, 0, 1}, axis) * best.rotation;
    other.scale *= std::exp(0.01 * double(rng.normal()));
    other.translation += test::random_vector(rng) * 0.01;
    EXPECT_GE(cost(other), cost(best));
  }
}

TEST(FitSimilarity, PointsOnALineAreRefused) {
  const std::vector<Vec3d> line = {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}};
  EXPECT_THROW((void)test::fit_similarity(line, line), InputError);
}

TEST(SymmetricEigen, VectorsSolveTheEquation) {
  SequentialRng rng(6, 0);
  for (int trial = 0; trial < 50; ++trial) {
    Mat3d m{};
    for (const Vec3d& p : random_points(rng, 4)) {
      for (int row = 0; row < 3; ++row) m.rows[row] += p * p[row];
    }
    const SymmetricEigen eigen = symmetric_eigen(m);
    for (int i = 0; i < 3; ++i) {
      const Vec3d v = eigen.vectors.column(i);
      EXPECT_LT(length(m * v - v * eigen.values[i]), 1e-8);
    }
    EXPECT_LE(eigen.values.x, eigen.values.y);
    EXPECT_LE(eigen.values.y, eigen.values.z);
    EXPECT_NEAR(eigen.vectors.determinant(), 1, kExact);
  }
}

TEST(RotationBetween, TurnsOneIntoTheOtherBySmallestAngle) {
  SequentialRng rng(7, 0);
  for (int trial = 0; trial < 50; ++trial) {
    const Vec3d a = normalized(test::random_vector(rng)), b = normalized(test::random_vector(rng));
    const Mat3d r = rotation_between(a, b);
    EXPECT_LT(length(r * a - b), kExact);
    EXPECT_NEAR(test::rotation_angle(r), std::acos(dot(a, b)), 1e-6);
  }
  const Mat3d half_turn = rotation_between({0, 0, 1}, {0, 0, -1});
  EXPECT_LT(length(half_turn * Vec3d{0, 0, 1} - Vec3d{0, 0, -1}), kExact);
  EXPECT_NEAR(half_turn.determinant(), 1, kExact);
}

TEST(ComparePoses, SeesATurnAndAShiftOfOneCamera) {
  SequentialRng rng(8, 0);
  std::vector<Affined> truth;
  for (int i = 0; i < 40; ++i) truth.push_back({test::random_rotation(rng), test::random_vector(rng)});
  const Similarity s = test::random_similarity(rng);
  std::vector<Affined> poses;
  for (const Affined& pose : truth) poses.push_back(s.pose(pose));
  const test::PoseComparison same = test::compare_poses(poses, truth);
  for (const double degrees : same.rotation_degrees) EXPECT_LT(degrees, 1e-6);
  for (const double error : same.centre_errors) EXPECT_LT(error, 1e-9);

  poses[5].linear = rotation_between({0, 0, 1}, normalized(Vec3d{0, std::tan(0.05), 1})) * poses[5].linear;
  EXPECT_NEAR(test::compare_poses(poses, truth).rotation_degrees[5], 0.05 * 180 / 3.14159265358979, 1e-6);
}

}  // namespace
}  // namespace cnerf::prepare
