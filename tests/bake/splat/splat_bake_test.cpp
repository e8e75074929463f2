/// Splats of a field that is given by a formula, judged by the plain rasterizer at cameras they were not fitted to.

#include <gtest/gtest.h>

#include <numbers>
#include <optional>

#include "bake/splat/bake_splats.h"
#include "bake/splat/place.h"
#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/color/colorspace_math.h"
#include "tests/bake/analytic_field.h"
#include "tests/bake/splat/reference_rasterizer.h"

namespace cnerf::bake::test {
namespace {

constexpr Vec3d kCentre{1, 2, 3};
constexpr double kRadius = 0.5;

/// A ball with patches of colour that is brighter seen from one side than from the other.
Vec3f ball_color(Vec3d normal, Vec3d direction, bool is_shaded) {
  const double wave = std::sin(7 * normal.x) * std::sin(6 * normal.y + 1) * std::cos(5 * normal.z);
  const double light = is_shaded ? 1 + 0.4 * direction.x : 1;
  return Vec3d{(0.35 + 0.25 * wave) * light, (0.3 - 0.2 * wave) * light, 0.25 * light}.cast<float>();
}

DrawField ball(bool is_shaded) {
  return [is_shaded](const Intrinsics& lens, const Affined& world_from_camera) {
    const std::size_t pixels = std::size_t(lens.width) * std::size_t(lens.height);
    FieldPicture picture{std::vector<float>(3 * pixels), std::vector<float>(pixels), std::vector<float>(pixels)};
    for (std::size_t p = 0; p < pixels; ++p) {
      const auto width = std::size_t(lens.width);
      const Vec3d in_camera = ray_direction(lens, {double(p % width) + 0.5, double(p / width) + 0.5});
      const Vec3d direction = world_from_camera.direction(in_camera);
      const Vec3d from = world_from_camera.translation - kCentre;
      const double half = dot(from, direction), rest = half * half - dot(from, from) + kRadius * kRadius;
      if (rest < 0) continue;
      const double distance = -half - std::sqrt(rest);
      const Vec3f color = ball_color((from + direction * distance) / kRadius, direction, is_shaded);
      for (int c = 0; c < 3; ++c) picture.rgb[3 * p + std::size_t(c)] = color[c];
      picture.opacity[p] = 1;
      picture.depth[p] = float(distance * in_camera.z);
    }
    return picture;
  };
}

/// On a circle and above it, looking at the ball.
Camera around(double share) {
  const double angle = 2 * std::numbers::pi * share;
  const Vec3d eye = kCentre + Vec3d{2 * std::cos(angle), 2 * std::sin(angle), 0.6 * std::sin(3 * angle)};
  return camera_at("camera " + std::to_string(share), eye, kCentre, 64, 48, 90);
}

SplatJob job_of(bool is_shaded, int count, int steps) {
  SplatJob job;
  job.draw = ball(is_shaded);
  job.frame = {kCentre, 0.5, 1};
  for (int i = 0; i < 10; ++i) job.cameras.push_back(around(i / 10.0));
  job.options.count = count;
  job.options.steps = steps;
  return job;
}

/// dB of encoded colour at cameras between those of the job, of which none is a target.
double held_out_psnr(const SplatCloud& cloud, const DrawField& draw) {
  double sum = 0;
  std::size_t values = 0;
  for (const double share : {0.03, 0.37, 0.72}) {
    const Camera camera = around(share);
    const auto ours = reference_picture(file_splats(cloud.splats), camera.intrinsics, camera.world_from_camera,
                                        {nearest_splat(cloud.frame), kViewerBlur});
    const FieldPicture wanted = draw(camera.intrinsics, camera.world_from_camera);
    for (std::size_t i = 0; i < wanted.rgb.size(); ++i, ++values) {
      sum += std::pow(std::min(1.0, ours[i / 3 * 4 + i % 3]) - double(srgb_from_linear(wanted.rgb[i])), 2);
    }
  }
  return -10 * std::log10(sum / double(values));
}

TEST(SplatBake, LooksLikeTheFieldWhereNobodyLooked) {
  Observer nobody;
  const SplatCloud placed = bake_splats(job_of(true, 1500, 0), nobody);
  const SplatCloud fitted = bake_splats(job_of(true, 1500, 150), nobody);
  EXPECT_LE(fitted.splats.size(), 1500u);
  EXPECT_GT(fitted.splats.size(), 500u);
  const double first = held_out_psnr(placed, ball(true)), last = held_out_psnr(fitted, ball(true));
  RecordProperty("placed", std::to_string(first));
  RecordProperty("fitted", std::to_string(last));
  std::printf("placed %.2f dB, fitted %.2f dB\n", first, last);
  EXPECT_GT(last, 27);
  EXPECT_GT(last, first + 3);
}

TEST(SplatBake, ShadingCarriesWhatDependsOnTheDirection) {
  Observer nobody;
  SplatCloud cloud = bake_splats(job_of(true, 1000, 150), nobody);
  const double shaded = held_out_psnr(cloud, ball(true));
  for (Splat& splat : cloud.splats) splat.shading = {};
  EXPECT_GT(shaded, held_out_psnr(cloud, ball(true)) + 1);
}

TEST(SplatBake, DoesNotDependOnThreads) {
  Observer nobody;
  std::vector<std::vector<Splat>> results;
  for (const int threads : {1, 3}) {
    set_thread_count(threads);
    results.push_back(bake_splats(job_of(true, 300, 30), nobody).splats);
  }
  set_thread_count(0);
  ASSERT_EQ(results[0].size(), results[1].size());
  for (std::size_t i = 0; i < results[0].size(); ++i) ASSERT_EQ(row_of(results[0][i]), row_of(results[1][i])) << i;
}

TEST(SplatBake, RefusesAFieldThatShowsNothing) {
  Observer nobody;
  SplatJob job = job_of(false, 100, 10);
  job.draw = [](const Intrinsics& lens, const Affined&) {
    const std::size_t pixels = std::size_t(lens.width) * std::size_t(lens.height);
    return FieldPicture{std::vector<float>(3 * pixels), std::vector<float>(pixels), std::vector<float>(pixels)};
  };
  EXPECT_THROW((void)bake_splats(job, nobody), InputError);
}

TEST(SplatBake, StopsWhenItIsCancelled) {
  struct Impatient : Observer {
    double reached = 0;
    void report_progress(const Progress& progress) override { reached = progress.fraction; }
    [[nodiscard]] bool is_cancelled() const override { return reached > 0.5; }
  } observer;
  EXPECT_THROW((void)bake_splats(job_of(false, 300, 100), observer), Interrupted);
  EXPECT_LT(observer.reached, 0.6);
}

TEST(SplatTargets, LieAtTheCamerasAndBetweenThem) {
  std::vector<Camera> cameras;
  for (int i = 0; i < 10; ++i) cameras.push_back(around(i / 10.0));
  const std::vector<Camera> targets = target_cameras(cameras);
  ASSERT_GT(targets.size(), cameras.size());
  for (std::size_t i = cameras.size(); i < targets.size(); ++i) {
    const auto& [linear, centre] = targets[i].world_from_camera;
    EXPECT_NEAR(linear.determinant(), 1, 1e-9);
    EXPECT_GT(dot(linear.column(2), normalized(kCentre - centre)), 0.99) << "looks elsewhere";
  }
}

TEST(SplatTargets, ReducedPicturesHaveNoDistortionAndTheirShareOfBlur) {
  Camera camera = around(0);
  camera.intrinsics.model = LensModel::kOpenCv;
  camera.intrinsics.distortion = {0.1, 0.02};
  const auto targets = draw_targets({camera}, ball(false), 16, [](double) {});
  EXPECT_EQ(targets[0].intrinsics.width, 16);
  EXPECT_EQ(targets[0].intrinsics.model, LensModel::kPinhole);
  EXPECT_NEAR(targets[0].blur, 0.3 / 16, 1e-12);
  EXPECT_EQ(targets[0].rgba.size(), 4u * 16 * 12);
}

TEST(SplatPlacement, DiscsLieFlatOnTheSurface) {
  const auto targets = draw_targets({around(0)}, ball(false), 64, [](double) {});
  int found = 0;
  for (const PlacedSplat& placed : place_splats(targets, 400)) {
    const Vec3d out = placed.splat.position.cast<double>() - kCentre;
    EXPECT_NEAR(length(out), kRadius, 1e-4);
    const auto turn = matrix_of_quaternion(
        {placed.splat.rotation[0], placed.splat.rotation[1], placed.splat.rotation[2], placed.splat.rotation[3]});
    const Vec3d normal{turn[0][2], turn[1][2], turn[2][2]};
    EXPECT_LT(placed.splat.log_scale.z, placed.splat.log_scale.x - 1);
    found += std::abs(dot(normal, normalized(out))) > 0.95 ? 1 : 0;
  }
  EXPECT_GT(found, 200);
}

}  // namespace
}  // namespace cnerf::bake::test
