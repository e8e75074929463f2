// Style transfer: its maths against closed forms and finite differences, and that it does what it is for.

#include "src/compare/baselines/style_transfer.h"

#include <gtest/gtest.h>

#include <cmath>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/color/colorspace_math.h"
#include "src/compare/baselines/torch/style_math.h"
#include "src/train/luminance/stage1.h"
#include "src/train/scene.h"
#include "tests/support/data.h"
#include "tests/support/finite_difference.h"
#include "tests/support/toy_capture.h"

namespace cnerf::compare {
namespace {
namespace fs = std::filesystem;

const auto kDouble = torch::TensorOptions().dtype(torch::kFloat64);

std::vector<double> doubles(const torch::Tensor& values) {
  const torch::Tensor flat = values.detach().contiguous().view({-1});
  return {flat.data_ptr<double>(), flat.data_ptr<double>() + flat.numel()};
}

TEST(StyleMath, ColoursAreOurs) {
  const std::vector<double> l = {30, 55, 80, 8}, a = {10, -25, 4, 1}, b = {-15, 30, 20, -2};
  const torch::Tensor lightness = torch::tensor(l, kDouble).view({2, 2});
  const torch::Tensor ab = torch::stack({torch::tensor(a, kDouble), torch::tensor(b, kDouble)}).view({2, 2, 2});
  const std::vector<double> ours = doubles(style::srgb(lightness, ab));
  for (std::size_t i = 0; i < 4; ++i) {
    const Vec3d rgb = linear_rgb_from_lab<double>({l[i], a[i], b[i]});
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_NEAR(ours[4 * c + i], srgb_from_linear(std::clamp(rgb[int(c)], 0.0, 1.0)), 1e-9);
    }
  }
  torch::Tensor leaf = ab.clone().requires_grad_(true);
  style::srgb(lightness, leaf).square().sum().backward();
  const auto f = [&](const std::vector<double>& values) {
    return style::srgb(lightness, torch::tensor(values, kDouble).view({2, 2, 2})).square().sum().item<double>();
  };
  const auto numeric = test::central_difference(doubles(ab), {0, 1, 2, 3, 4, 5, 6, 7}, 1e-5, f);
  EXPECT_LT(test::worst_relative_error(doubles(leaf.grad()), numeric), 1e-6);
}

TEST(StyleMath, TheNearestFeatureIsMatched) {
  // Three directions of a plane; the reference has two.
  const torch::Tensor features = torch::tensor({1.0, 0.0, 3.0, 0.0, 2.0, 3.0}, kDouble).view({1, 2, 1, 3});
  const torch::Tensor ours = style::unit_vectors(features);
  const torch::Tensor reference = torch::tensor({1.0, 0.0, 0.6, 0.8}, kDouble).view({2, 2});
  // (1, 0) is there; (0, 1) is nearest to (0.6, 0.8); (1, 1) / sqrt 2 too, at 1.4 / sqrt 2.
  const double expected = (0 + (1 - 0.8) + (1 - 1.4 / std::sqrt(2.0))) / 3;
  EXPECT_NEAR(style::nearest_neighbour_loss(ours, reference).item<double>(), expected, 1e-7);
  EXPECT_NEAR(style::nearest_neighbour_loss(reference, reference).item<double>(), 0, 1e-12);

  torch::Tensor leaf = features.clone().requires_grad_(true);
  style::nearest_neighbour_loss(style::unit_vectors(leaf), reference).backward();
  const auto f = [&](const std::vector<double>& values) {
    const torch::Tensor at = torch::tensor(values, kDouble).view({1, 2, 1, 3});
    return style::nearest_neighbour_loss(style::unit_vectors(at), reference).item<double>();
  };
  const auto numeric = test::central_difference(doubles(features), {0, 1, 2, 3, 4, 5}, 1e-6, f);
  EXPECT_LT(test::worst_relative_error(doubles(leaf.grad()), numeric), 1e-5);
}

/// A picture of one colour.
LabPicture plain(Ab color) {
  LabPicture picture{64, 56, {}, {}};
  for (int i = 0; i < 64 * 56; ++i) picture.lightness.push_back(50 + 20 * std::sin(0.7f * float(i % 64)));
  picture.ab.assign(64 * 56, color.a);
  picture.ab.insert(picture.ab.end(), 64 * 56, color.b);
  return picture;
}

class StyleTransfer : public testing::Test {
 protected:
  void SetUp() override {
    CNERF_REQUIRE_DATA(weights, "lpips/lpips_alex_f32.bin");
    weights_ = weights;
  }
  fs::path weights_;
};

TEST_F(StyleTransfer, TheGradientPointsAwayFromTheReference) {
  const auto made = make_style_loss(weights_, plain({40, 30}));
  const StyleLoss& loss = *made;
  std::vector<float> gradient(2 * 64 * 56);
  EXPECT_NEAR(loss(plain({40, 30}), gradient), 0, 1e-4);
  const double grey = loss(plain({0, 0}), gradient);
  const double opposite = loss(plain({-30, -20}), gradient);
  EXPECT_GT(grey, 1e-3);
  EXPECT_GT(opposite, grey);

  // A step down the gradient lowers the loss.
  LabPicture moved = plain({0, 0});
  (void)loss(moved, gradient);
  double norm = 0;
  for (const float g : gradient) norm += double(g) * g;
  ASSERT_GT(norm, 0);
  for (std::size_t i = 0; i < moved.ab.size(); ++i) moved.ab[i] -= float(100 / std::sqrt(norm)) * gradient[i];
  std::vector<float> unused(gradient.size());
  EXPECT_LT(loss(moved, unused), grey);
}

TEST_F(StyleTransfer, BringsAFieldNearerToItsReference) {
  const test::TempDir folder;
  Capture capture = test::toy_capture(4, 64, 56);
  Stage1Options stage1;
  stage1.steps = 30;
  stage1.samples_per_step = 2048;
  stage1.steps_per_box = 64;
  stage1.grid = {.levels = 3, .log2_rows = 10, .coarsest_resolution = 4, .finest_resolution = 32};
  stage1.occupancy.resolution = 32;
  Observer observer;
  (void)train_stage1({capture, stage1, folder / "stage1.snapshot"}, cpu_engines(), observer);

  const LabPicture reference = plain({40, 30});
  const auto loss = make_style_loss(weights_, reference);
  Stage2Options options;
  options.grid = stage1.grid;
  const double seconds =
      transfer_style({capture, folder / "stage1.snapshot", *loss, reference, options, 40, folder / "take.snapshot"},
                     cpu_engines(), observer);
  EXPECT_GT(seconds, 0);

  const auto scene = Scene::load(folder / "stage1.snapshot", folder / "take.snapshot", cpu_engines());
  const View& view = capture.views[1];
  const RenderedImage image = scene->render(view.intrinsics, view.world_from_camera);
  double a = 0, b = 0, n = 0;
  for (std::size_t p = 0; p < image.opacity.size(); ++p) {
    if (image.opacity[p] < 0.5f || image.luminance[p] < 0.1f) continue;
    const Lab<float> lab = lab_from_linear_rgb(Vec3f{image.rgb[3 * p], image.rgb[3 * p + 1], image.rgb[3 * p + 2]});
    a += lab.a;
    b += lab.b;
    n += 1;
  }
  ASSERT_GT(n, 100);
  EXPECT_GT(a / n, 15);
  EXPECT_GT(b / n, 10);
}

/// What the plug-in throws is caught here by its type: both sides have the same types of errors.
TEST(StyleLossPlugin, WhatCannotBeUsedIsRefusedByAnErrorOfTheProgram) {
  EXPECT_THROW((void)make_style_loss("missing.bin", plain({})), MissingInputError);
  const test::TempDir folder;
  write_file(folder / "short.bin", "no weights");
  write_file(folder / "short.txt", "conv1.weight 64x3x11x11 0\n");
  EXPECT_THROW((void)make_style_loss(folder / "short.bin", plain({})), InputError);
  write_file(folder / "other.bin", "1234");
  write_file(folder / "other.txt", "core.weight 1 0\n");
  EXPECT_THROW((void)make_style_loss(folder / "other.bin", plain({})), InputError);
}

TEST_F(StyleTransfer, ASmallReferenceIsRefused) {
  const LabPicture small{20, 20, std::vector<float>(400, 50.0f), std::vector<float>(800, 0.0f)};
  EXPECT_THROW((void)make_style_loss(weights_, small), InputError);
}

}  // namespace
}  // namespace cnerf::compare
