// Style transfer: its maths against closed forms and finite differences, and that it does what it is for.

#include "src/compare/baselines/style_transfer.h"

#include <gtest/gtest.h>
#include <torch/script.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/color/colorspace_math.h"
#include "src/compare/baselines/simulated.h"
#include "src/compare/baselines/torch/style_math.h"
#include "src/compare/run.h"
#include "src/sample/sample_scene.h"
#include "src/train/luminance/stage1.h"
#include "src/train/scene.h"
#include "tests/compare/double_tensors.h"
#include "tests/support/data.h"
#include "tests/support/finite_difference.h"
#include "tests/support/tiny_config.h"
#include "tests/support/toy_capture.h"

namespace cnerf::compare {
namespace {
namespace fs = std::filesystem;

TEST(StyleMath, ColoursAreOurs) {
  const std::vector<double> l = {30, 55, 80, 8}, a = {10, -25, 4, 1}, b = {-15, 30, 20, -2};
  const torch::Tensor lightness = torch::tensor(l, test::kDouble).view({2, 2});
  const torch::Tensor ab =
      torch::stack({torch::tensor(a, test::kDouble), torch::tensor(b, test::kDouble)}).view({2, 2, 2});
  const std::vector<double> ours = test::doubles(style::srgb(lightness, ab));
  for (std::size_t i = 0; i < 4; ++i) {
    const Vec3d rgb = linear_rgb_from_lab<double>({l[i], a[i], b[i]});
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_NEAR(ours[4 * c + i], srgb_from_linear(std::clamp(rgb[int(c)], 0.0, 1.0)), 1e-9);
    }
  }
  torch::Tensor leaf = ab.clone().requires_grad_(true);
  style::srgb(lightness, leaf).square().sum().backward();
  const auto f = [&](const std::vector<double>& values) {
    return style::srgb(lightness, torch::tensor(values, test::kDouble).view({2, 2, 2})).square().sum().item<double>();
  };
  const auto numeric = test::central_difference(test::doubles(ab), {0, 1, 2, 3, 4, 5, 6, 7}, 1e-5, f);
  EXPECT_LT(test::worst_relative_error(test::doubles(leaf.grad()), numeric), 1e-6);
}

TEST(StyleMath, TheNearestFeatureIsMatched) {
  // Three directions of a plane; the reference has two.
  const torch::Tensor features = torch::tensor({1.0, 0.0, 3.0, 0.0, 2.0, 3.0}, test::kDouble).view({1, 2, 1, 3});
  const torch::Tensor ours = style::unit_vectors(features);
  const torch::Tensor reference = torch::tensor({1.0, 0.0, 0.6, 0.8}, test::kDouble).view({2, 2});
  // (1, 0) is there; (0, 1) is nearest to (0.6, 0.8); (1, 1) / sqrt 2 too, at 1.4 / sqrt 2.
  const double expected = (0 + (1 - 0.8) + (1 - 1.4 / std::sqrt(2.0))) / 3;
  EXPECT_NEAR(style::nearest_neighbour_loss(ours, reference).item<double>(), expected, 1e-7);
  EXPECT_NEAR(style::nearest_neighbour_loss(reference, reference).item<double>(), 0, 1e-12);

  torch::Tensor leaf = features.clone().requires_grad_(true);
  style::nearest_neighbour_loss(style::unit_vectors(leaf), reference).backward();
  const auto f = [&](const std::vector<double>& values) {
    const torch::Tensor at = torch::tensor(values, test::kDouble).view({1, 2, 1, 3});
    return style::nearest_neighbour_loss(style::unit_vectors(at), reference).item<double>();
  };
  const auto numeric = test::central_difference(test::doubles(features), {0, 1, 2, 3, 4, 5}, 1e-6, f);
  EXPECT_LT(test::worst_relative_error(test::doubles(leaf.grad()), numeric), 1e-5);
}

/// A picture of one colour.
LabPicture plain(Ab color) {
  LabPicture picture{64, 56, {}, {}};
  for (int i = 0; i < 64 * 56; ++i) picture.lightness.push_back(50 + 20 * std::sin(0.7f * float(i % 64)));
  picture.ab.assign(64 * 56, color.a);
  picture.ab.insert(picture.ab.end(), 64 * 56, color.b);
  return picture;
}

/// A trained toy, whose colours follow a loss.
struct ToyScene {
  explicit ToyScene(const fs::path& at) : folder(at) {
    stage1.steps = 30;
    stage1.samples_per_step = 2048;
    stage1.steps_per_box = 64;
    stage1.grid = {.levels = 3, .log2_rows = 10, .coarsest_resolution = 4, .finest_resolution = 32};
    stage1.occupancy.resolution = 32;
    Observer observer;
    (void)train_stage1({capture, stage1, folder / "stage1.snapshot"}, cpu_engines(), observer);
  }

  /// Mean ab of a view's bright pixels once its colours followed the loss.
  [[nodiscard]] Ab learnt(const PictureLoss& loss, const LabPicture* reference) const {
    Stage2Options options;
    options.grid = stage1.grid;
    Observer observer;
    const fs::path take = folder / "take.snapshot";
    const StyleJob job{capture, folder / "stage1.snapshot", loss, reference, options, 40, take, "loss"};
    EXPECT_GT(transfer_style(job, cpu_engines(), observer), 0);
    const auto scene = Scene::load(folder / "stage1.snapshot", take, cpu_engines());
    const View& view = capture.views[1];
    const RenderedImage image = scene->render(view.intrinsics, view.world_from_camera);
    Ab sum;
    int count = 0;
    for (std::size_t p = 0; p < image.opacity.size(); ++p) {
      if (image.opacity[p] < 0.5f || image.luminance[p] < 0.1f) continue;
      const Lab<float> lab = lab_from_linear_rgb(Vec3f{image.rgb[3 * p], image.rgb[3 * p + 1], image.rgb[3 * p + 2]});
      sum = {sum.a + lab.a, sum.b + lab.b};
      ++count;
    }
    EXPECT_GT(count, 100);
    return {sum.a / float(count), sum.b / float(count)};
  }

  fs::path folder;
  Capture capture = test::toy_capture(4, 64, 56);
  Stage1Options stage1;
};

/// Encoders of a picture's mean colours: [1, 3] of the picture, and of the words red, green and blue what they are.
struct SmallPair {
  explicit SmallPair(const fs::path& folder, const std::string& image = "return x.mean([2, 3])") {
    torch::jit::Module images("images");
    images.define("def forward(self, x):\n  " + image + "\n");
    images.save((folder / "image.pt").string());
    torch::jit::Module texts("texts");
    texts.define(R"(
def forward(self, text: str):
  known = [[1.0, -0.5, -0.5], [-0.5, 1.0, -0.5], [-0.5, -0.5, 1.0]]
  return torch.tensor([known[["red", "green", "blue"].index(text)]])
)");
    texts.save((folder / "text.pt").string());
    guide = {folder / "image.pt", folder / "text.pt", "red"};
  }
  TextGuide guide;
};

TEST(TextLoss, ItsGradientIsThatOfTheCosineBetweenTheEncodersAnswers) {
  const test::TempDir folder;
  const auto loss = make_text_loss(SmallPair(folder.path()).guide);
  const LabPicture red = plain({50, 30}), green = plain({-40, 30});
  std::vector<float> gradient(red.ab.size()), unused(red.ab.size());
  EXPECT_LT((*loss)(red, unused), (*loss)(green, gradient));
  // All pixels moved along a or along b: the gradient's sum is the derivative.
  const auto moved = [&](Ab by) { return (*loss)(plain({-40 + by.a, 30 + by.b}), unused); };
  const double a = (moved({0.5f, 0}) - moved({-0.5f, 0})), b = (moved({0, 0.5f}) - moved({0, -0.5f}));
  const std::size_t half = gradient.size() / 2;
  EXPECT_NEAR(std::accumulate(gradient.begin(), gradient.begin() + std::ptrdiff_t(half), 0.0), a, 0.02 * std::abs(a));
  EXPECT_NEAR(std::accumulate(gradient.begin() + std::ptrdiff_t(half), gradient.end(), 0.0), b, 0.02 * std::abs(b));
}

TEST(TextLoss, WhatIsNoSuchPairIsRefusedByTheNameOfTheFile) {
  const test::TempDir folder;
  TextGuide guide = SmallPair(folder.path()).guide;
  const auto refusal = [](const TextGuide& given) {
    try {
      (void)make_text_loss(given);
    } catch (const InputError& problem) {
      return std::string(problem.what());
    }
    return std::string();
  };
  EXPECT_EQ(refusal(guide), "");
  guide.text = "mauve";
  EXPECT_NE(refusal(guide).find("text.pt"), std::string::npos);
  guide.text = "red";
  write_file(folder / "other.pt", "no network");
  guide.image_encoder = folder / "other.pt";
  EXPECT_NE(refusal(guide).find("other.pt"), std::string::npos);
  const test::TempDir second;
  EXPECT_NE(refusal(SmallPair(second.path(), "return x.mean([3])").guide).find("expected 3 numbers"),
            std::string::npos);
  guide.image_encoder = folder / "missing.pt";
  EXPECT_THROW((void)make_text_loss(guide), MissingInputError);
}

TEST(TextLoss, BringsAFieldToTheColourThatTheTextNames) {
  const test::TempDir folder;
  const ToyScene scene(folder.path());
  for (const auto& [text, sign] : {std::pair{"red", 1.0f}, std::pair{"green", -1.0f}}) {
    TextGuide guide = SmallPair(folder.path()).guide;
    guide.text = text;
    const auto loss = make_text_loss(guide);
    const Ab mean = scene.learnt(*loss, nullptr);
    EXPECT_GT(sign * mean.a, 10) << text;
  }
}

TEST(TextLoss, IsARowOfAComparison) {
  const test::TempDir folder;
  write_sample_scene(folder / "capture", {.views = 6, .width = 96, .height = 72, .samples_per_pixel = 1});
  Config config = test::tiny_config();
  config.capture.holdout = 3;
  config.render.frames = 4;
  config.render.short_side = 24;
  config.colorizer.spec = kSimulated;
  Plan plan;
  plan.captures = {{folder / "capture"}};
  plan.report = folder / "report";
  plan.methods = parse_methods("clip-nerf,grey");
  plan.seeds = {1};
  plan.text = SmallPair(folder.path()).guide;
  Observer observer;
  compare::Run run(plan, config, observer);
  run.run();
  run.write_report();
  const auto row = nlohmann::json::parse(read_text_file(folder / "report/table.json"))["tables"][0]["rows"][0];
  EXPECT_EQ(row["method"], "clip-nerf");
  EXPECT_FALSE(row.contains("error")) << row.dump();
  EXPECT_GT(row["colourfulness"]["mean"], 2);
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
  const PictureLoss& loss = *made;
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
  const LabPicture reference = plain({40, 30});
  const Ab mean = ToyScene(folder.path()).learnt(*make_style_loss(weights_, reference), &reference);
  EXPECT_GT(mean.a, 15);
  EXPECT_GT(mean.b, 10);
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
