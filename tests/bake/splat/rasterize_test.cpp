/// The rasterizer of splats against the plain one, and its gradient against finite differences.

#include "bake/splat/rasterize.h"

#include <gtest/gtest.h>

#include "src/base/parallel.h"
#include "src/base/rng.h"
#include "tests/bake/analytic_field.h"
#include "tests/bake/splat/reference_rasterizer.h"
#include "tests/support/finite_difference.h"
#include "tests/support/isa.h"

namespace cnerf::bake::test {
using namespace cnerf::test;
namespace {

constexpr double kNear = 0.01;

/// Splats of all shapes in front of a camera, some of them beside its picture and behind it.
std::vector<Splat> cloud_of(std::size_t count, std::uint64_t seed = 3) {
  SequentialRng rng(seed, named_stream("cloud"));
  std::vector<Splat> splats;
  for (std::size_t i = 0; i < count; ++i) {
    Splat splat;
    splat.position = {rng.uniform(-1.2f, 1.2f), rng.uniform(-1, 4), rng.uniform(-1, 1)};
    splat.log_scale = {rng.uniform(-4, -1.5f), rng.uniform(-4, -1.5f), rng.uniform(-5, -2)};
    for (float& part : splat.rotation) part = rng.normal();
    splat.opacity_logit = rng.uniform(-3, 6);
    splat.color = {rng.uniform(), rng.uniform(), rng.uniform()};
    for (float& part : splat.shading) part = rng.uniform(-0.2f, 0.2f);
    splats.push_back(splat);
  }
  return splats;
}

Camera camera_of(int width = 43, int height = 37) {
  Camera camera = camera_at("camera", {0.3, -2, 0.4}, {0, 1, 0}, width, height, 40);
  camera.intrinsics.cx += 1.25;
  camera.intrinsics.fy *= 1.1;
  return camera;
}
SplatCamera<float> splat_camera_of(const Camera& camera) {
  return splat_camera<float>(camera.intrinsics, camera.world_from_camera, kNear);
}

std::vector<double> values_of(const SplatPicture& picture) {
  std::vector<double> values;
  for (std::size_t p = 0; p < picture.opacity.size(); ++p) {
    for (std::size_t c = 0; c < 3; ++c) values.push_back(double(picture.rgb[3 * p + c]));
    values.push_back(double(picture.opacity[p]));
  }
  return values;
}

/// A loss that every value of the picture has a part in.
std::vector<double> weights_of(std::size_t count) {
  SequentialRng rng(1, named_stream("weights"));
  std::vector<double> weights;
  for (std::size_t i = 0; i < count; ++i) weights.push_back(double(rng.uniform(-1, 1)));
  return weights;
}
double weighted(const std::vector<double>& values, const std::vector<double>& weights) {
  double sum = 0;
  for (std::size_t i = 0; i < values.size(); ++i) sum += values[i] * weights[i];
  return sum;
}

std::vector<double> analytic_gradient(const std::vector<Splat>& splats, const Camera& camera) {
  SplatRasterizer rasterizer;
  SplatPicture d = rasterizer.draw(splats, splat_camera_of(camera));
  const std::vector<double> weights = weights_of(d.opacity.size() * 4);
  for (std::size_t p = 0; p < d.opacity.size(); ++p) {
    for (std::size_t c = 0; c < 3; ++c) d.rgb[3 * p + c] = float(weights[4 * p + c]);
    d.opacity[p] = float(weights[4 * p + 3]);
  }
  const SplatGradients& gradients = rasterizer.gradient(splats, splat_camera_of(camera), d);
  std::vector<double> all(splats.size() * kSplatParameters, 0);
  for (std::size_t i = 0; i < gradients.splats.size(); ++i) {
    const SplatRow<float> row = row_of(gradients.gradients[i]);
    std::copy(row.begin(), row.end(), all.begin() + std::ptrdiff_t(gradients.splats[i] * kSplatParameters));
  }
  return all;
}

/// Of the plain rasterizer.
std::vector<double> numeric_gradient(const std::vector<Splat>& splats, const Camera& camera) {
  std::vector<double> parameters;
  for (const Splat& splat : splats) {
    for (const float value : row_of(splat)) parameters.push_back(double(value));
  }
  const std::vector<double> weights =
      weights_of(std::size_t(camera.intrinsics.width) * std::size_t(camera.intrinsics.height) * 4);
  const auto loss = [&](const std::vector<double>& values) {
    std::vector<FileSplat> moved;
    for (std::size_t i = 0; i < splats.size(); ++i) {
      SplatRow<double> row;
      std::copy_n(values.begin() + std::ptrdiff_t(i * kSplatParameters), kSplatParameters, row.begin());
      moved.push_back(file_splat(splat_of(row)));
    }
    return weighted(reference_picture(moved, camera.intrinsics, camera.world_from_camera, {kNear, kViewerBlur}),
                    weights);
  };
  std::vector<std::size_t> indices(parameters.size());
  for (std::size_t i = 0; i < indices.size(); ++i) indices[i] = i;
  return central_difference(parameters, indices, 1e-6, loss);
}

class SplatIsa : public testing::TestWithParam<IsaLevel> {};
INSTANTIATE_TEST_SUITE_P(, SplatIsa, testing::ValuesIn(available_isas()),
                         [](const auto& isa) { return to_string(isa.param); });

TEST_P(SplatIsa, PicturesEqualThePlainRasterizers) {
  const ScopedIsa isa(GetParam());
  const std::vector<Splat> splats = cloud_of(400);
  const Camera camera = camera_of();
  SplatRasterizer rasterizer;
  const std::vector<double> ours = values_of(rasterizer.draw(splats, splat_camera_of(camera)));
  const std::vector<double> plain =
      reference_picture(file_splats(splats), camera.intrinsics, camera.world_from_camera, {kNear, kViewerBlur});
  ASSERT_EQ(ours.size(), plain.size());
  // A pixel on the rim of a splat, where that is cut off at 1/255, may fall on either side in float.
  double worst = 0, sum = 0;
  for (std::size_t i = 0; i < ours.size(); ++i) {
    worst = std::max(worst, std::abs(ours[i] - plain[i]));
    sum += std::abs(ours[i] - plain[i]);
  }
  EXPECT_LT(sum / double(ours.size()), 2e-6);
  EXPECT_LT(worst, 1.5 / 255);
  EXPECT_GT(*std::ranges::max_element(plain), 0.5);
}

TEST_P(SplatIsa, GradientsEqualFiniteDifferencesOfThePlainRasterizer) {
  const ScopedIsa isa(GetParam());
  const std::vector<Splat> splats = cloud_of(24);
  const Camera camera = camera_of(24, 20);
  const std::vector<double> numeric = numeric_gradient(splats, camera);
  std::vector<double> analytic = analytic_gradient(splats, camera);
  for (std::size_t k = 0; k < kSplatParameters; ++k) {  // each kind by itself: they differ in size
    std::vector<double> a, n;
    for (std::size_t i = 0; i < splats.size(); ++i) {
      a.push_back(analytic[i * kSplatParameters + k]);
      n.push_back(numeric[i * kSplatParameters + k]);
    }
    EXPECT_LT(relative_distance(a, n), 1e-4) << "parameter " << k;  // rounding of float
    for (double& value : a) value = -value;
    EXPECT_GT(relative_distance(a, n), 1) << "parameter " << k << ": a flipped sign was not noticed";
  }
}

/// The formulas by themselves, in double: no rasterizer, no rounding.
TEST(SplatMath, GradientOfTheProjectionEqualsFiniteDifferences) {
  const Camera camera = camera_of();
  const auto in_view = splat_camera<double>(camera.intrinsics, camera.world_from_camera, kNear);
  const std::array<double, 9> weights = {0.3, -0.7, 11, 5, -3, 0.9, 0.4, -0.2, 0.8};
  const auto loss = [&](const std::vector<double>& values) {
    SplatRow<double> row;
    std::copy(values.begin(), values.end(), row.begin());
    const BasicSplat<double> splat = splat_of(row);
    const auto projection = SplatProjection<double>::of(splat, in_view);
    const FlatSplat<double>& f = projection->flat();
    const double of_shape[] = {f.x, f.y, f.a, f.b, f.c, f.opacity, f.color.x, f.color.y, f.color.z};
    double sum = 0;
    for (std::size_t i = 0; i < weights.size(); ++i) sum += weights[i] * of_shape[i];
    return sum;
  };
  int seen = 0;
  for (const Splat& splat : cloud_of(40)) {
    SplatRow<double> values{};
    const SplatRow<float> rounded = row_of(splat);
    std::copy(rounded.begin(), rounded.end(), values.begin());
    const BasicSplat<double> exact = splat_of(values);
    const auto projection = SplatProjection<double>::of(exact, in_view);
    if (!projection || projection->depth() < 0.5) continue;
    ++seen;
    FlatSplat<double> d{
        weights[0], weights[1], weights[2], weights[3], weights[4], weights[5], {weights[6], weights[7], weights[8]}};
    const SplatRow<double> row = row_of(projection->gradient(d));
    std::vector<std::size_t> indices(kSplatParameters);
    for (std::size_t i = 0; i < indices.size(); ++i) indices[i] = i;
    const auto numeric = central_difference({values.begin(), values.end()}, indices, 1e-6, loss);
    EXPECT_LT(relative_distance(std::vector<double>(row.begin(), row.end()), numeric), 1e-6);
  }
  EXPECT_GT(seen, 20);
}

TEST(SplatRasterizer, DoesNotDependOnThreads) {
  const std::vector<Splat> splats = cloud_of(500);
  const Camera camera = camera_of(70, 50);
  std::vector<std::vector<double>> pictures, gradients;
  for (const int threads : {1, 3}) {
    set_thread_count(threads);
    SplatRasterizer rasterizer;
    pictures.push_back(values_of(rasterizer.draw(splats, splat_camera_of(camera))));
    gradients.push_back(analytic_gradient(splats, camera));
  }
  set_thread_count(0);
  EXPECT_EQ(pictures[0], pictures[1]);
  EXPECT_EQ(gradients[0], gradients[1]);
}

TEST(SplatRasterizer, DrawsNothingOfNothing) {
  SplatRasterizer rasterizer;
  const SplatPicture& picture = rasterizer.draw({}, splat_camera_of(camera_of()));
  EXPECT_EQ(picture.rgb, std::vector<float>(43 * 37 * 3, 0.0f));
  EXPECT_EQ(picture.opacity, std::vector<float>(43 * 37, 0.0f));
}

}  // namespace
}  // namespace cnerf::bake::test
