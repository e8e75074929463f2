#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/color/ab_bins.h"
#include "src/colorizer/torch/network_weights.h"
#include "src/colorizer_training/score.h"
#include "src/colorizer_training/tar_reader.h"
#include "src/colorizer_training/trainer.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

/// Two classes that lightness tells apart: dark red pictures with a bright spot, bright blue ones with a dark spot.
TrainingImages two_class_images(int side, int count) {
  TrainingImages images;
  images.side = side;
  for (int i = 0; i < count; ++i) {
    const bool red = i % 2 == 0;
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) {
        const bool spot = (x - side / 2) * (x - side / 2) + (y - side / 2) * (y - side / 2) < side * side / 16;
        const int shade = (spot == red ? 60 : 0) + i;
        const std::uint8_t low = std::uint8_t(shade), high = std::uint8_t(120 + shade);
        images.rgb.insert(images.rgb.end(), {red ? high : low, std::uint8_t(shade + (red ? 0 : 60)), red ? low : high});
      }
    }
    images.aspect.push_back(1);
    images.label.push_back(i % 2);
  }
  return images;
}

ImageSet tiny_set() {
  ImageSet set;
  set.photos = two_class_images(48, 4);
  set.tiles = two_class_images(32, 4);
  set.classes.names = {"a/red", "a/blue"};
  set.classes.set_ranges = {{0, 2}};
  return set;
}

TrainerOptions tiny_options() {
  TrainerOptions options;
  options.steps = 40;
  options.photos_per_step = options.tiles_per_step = 2;
  options.crop_sides = {32};
  options.tile_crop_side = 32;
  options.warmup_steps = 5;
  return options;
}

TEST(ColorizerTrainer, LearnsATinySet) {
  const ImageSet set = tiny_set();
  ColorizerTrainer trainer(set, nullptr, {}, tiny_options(), torch::kCPU);
  const auto mean_loss = [&](int steps) {
    double sum = 0;
    for (int i = 0; i < steps; ++i) sum += trainer.step().classification.item<double>();
    return sum / steps;
  };
  const double before = mean_loss(4);
  (void)mean_loss(20);
  EXPECT_LT(mean_loss(4), 0.8 * before);
}

TEST(ColorizerTrainer, ContinuesBitForBit) {
  const test::TempDir folder;
  const ImageSet set = tiny_set();
  ColorizerTrainer straight(set, nullptr, {}, tiny_options(), torch::kCPU);
  for (int i = 0; i < 3; ++i) straight.step();
  straight.save(folder / "checkpoint.pt");
  const double expected = (straight.step(), straight.step()).classification.item<double>();

  ColorizerTrainer resumed(set, nullptr, {}, tiny_options(), torch::kCPU);
  resumed.load(folder / "checkpoint.pt");
  EXPECT_EQ(resumed.steps_done(), 3);
  EXPECT_EQ((resumed.step(), resumed.step()).classification.item<double>(), expected);
  const auto a = straight.averaged()->parameters(), b = resumed.averaged()->parameters();
  for (std::size_t i = 0; i < a.size(); ++i) ASSERT_TRUE(torch::equal(a[i], b[i]));
}

TEST(ColorizerTrainer, MeasuresStatisticsWhereTilesCameAlone) {
  const ImageSet set = tiny_set();
  const torch::Tensor lightness = 100 * torch::rand({1, 1, 32, 32});
  const torch::NoGradGuard no_grad;
  for (const double tile_share : {0.0, 0.5}) {
    TrainerOptions options = tiny_options();
    options.tile_share = tile_share;
    ColorizerTrainer trainer(set, nullptr, {}, options, torch::kCPU);
    {
      const torch::AutoGradMode with_gradients(true);
      for (int i = 0; i < 4; ++i) trainer.step();
    }
    const torch::Tensor before = trainer.averaged()->forward(lightness);
    trainer.measure_statistics();
    const torch::Tensor measured = trainer.averaged()->forward(lightness);
    EXPECT_EQ(torch::equal(before, measured), tile_share == 0);
    trainer.measure_statistics();
    EXPECT_TRUE(torch::equal(trainer.averaged()->forward(lightness), measured));
  }
}

TEST(DistillationLoss, IsTheRebalancedLossAveragedOverTheTruth) {
  torch::manual_seed(3);
  const SoftLabelTable table(torch::kCPU);
  const torch::Tensor logits = torch::randn({1, kAbBinCount, 1, 1}), weights = 0.2 + 3 * torch::rand({kAbBinCount});
  // Half of the pictures show one colour here, half another.
  const std::vector<torch::Tensor> truths = {torch::tensor({20.0f, 31.0f}).view({1, 2, 1, 1}),
                                             torch::tensor({-42.0f, 13.0f}).view({1, 2, 1, 1})};
  torch::Tensor average = torch::zeros({}), rebalanced = torch::zeros({kAbBinCount});
  for (const torch::Tensor& truth : truths) {
    average += 0.5 * color_loss(logits, truth, table, weights).classification;
    const auto target = table.look_up(truth);
    const torch::Tensor weight = weights.index_select(0, target.bin.select(1, 0));
    rebalanced.index_add_(0, target.bin[0], 0.5 * weight * target.weight[0]);
  }
  const torch::Tensor probability = (rebalanced / rebalanced.sum()).view({1, -1});
  const torch::Tensor flat = torch::ones({kAbBinCount});
  const torch::Tensor unweighted = -(probability * torch::log_softmax(logits.view({1, -1}), 1)).sum();
  EXPECT_NEAR(distillation_loss(logits, probability, flat).item<double>(), unweighted.item<double>(), 1e-5);
  const double emphasis = 1 / (probability.flatten() / weights).sum().item<double>();
  EXPECT_NEAR(distillation_loss(logits, probability, weights).item<double>(), emphasis * unweighted.item<double>(),
              1e-4);
  EXPECT_NEAR(average.item<double>(), (rebalanced.sum() * unweighted).item<double>(), 1e-4);
}

TEST(ColorizerTrainer, LearnsFromAnEnsembleWhatTheTruthDoesNotSay) {
  const test::TempDir folder;
  const ImageSet set = tiny_set();
  torch::manual_seed(4);
  ColorizerNet always_green(Normalisation::kFolded);
  {
    const torch::NoGradGuard no_grad;
    torch::Tensor offsets = torch::zeros({kAbBinCount});
    offsets[nearest_bin({-50, 40})] = 30;
    always_green->shift_logits(offsets);
  }
  save_colorizer_weights(folder / "green.weights", always_green, {});
  TrainerOptions options = tiny_options();
  options.distillation_share = 1;
  options.regression_weight = 0;
  ColorizerTrainer trainer(set, nullptr, Ensemble({folder / "green.weights"}, torch::kCPU), options, torch::kCPU);
  const double before = trainer.step().classification.item<double>();
  double after = before;
  for (int i = 1; i < options.steps; ++i) after = trainer.step().classification.item<double>();
  // The pictures themselves are red and blue: without the ensemble the answer of one green would stay wrong.
  EXPECT_LT(after, 0.5 * before);
  EXPECT_THROW(Ensemble({folder / "none.weights"}, torch::kCPU), MissingInputError);
}

TEST(ColorizerTrainer, RefusesOtherCheckpoints) {
  const test::TempDir folder;
  const ImageSet set = tiny_set();
  ColorizerTrainer trainer(set, nullptr, {}, tiny_options(), torch::kCPU);
  EXPECT_THROW(trainer.load(folder / "none.pt"), MissingInputError);
  write_file(folder / "short.pt", std::string_view("not a checkpoint"));
  EXPECT_THROW(trainer.load(folder / "short.pt"), SnapshotError);
}

TEST(LoadImageSet, HoldsOutMoreOnRequestAndNeverAnImageTwice) {
  const test::TempDir folder;
  constexpr std::size_t kImages = 60;
  for (std::size_t i = 0; i < kImages; ++i) {
    std::filesystem::create_directories(folder / "photos/set/class");
    write_png(folder / ("photos/set/class/" + std::to_string(i) + ".png"), {8, 8, std::vector<std::uint8_t>(192, 99)});
  }
  ImageSources sources;
  sources.photos = {folder / "photos"};
  std::size_t before = 0;
  for (const int parts : {3, 8, 19}) {
    sources.held_out = parts;
    ImageSet set = load_image_set(sources);
    const std::size_t held_out = set.validation["set"].size();
    EXPECT_EQ(set.photos.size() + held_out, kImages);
    EXPECT_GT(held_out, before);
    before = held_out;
  }
}

TEST(MakeBatch, IsAPureFunctionOfTheStep) {
  const ImageSet set = tiny_set();
  const ResidentImages photos(set.photos, torch::kCPU);
  const auto batch = [&](std::int64_t step) { return make_batch({{&photos, 3}}, 32, AugmentOptions{}, 9, step); };
  EXPECT_TRUE(torch::equal(batch(4).lightness, batch(4).lightness));
  EXPECT_FALSE(torch::equal(batch(4).lightness, batch(5).lightness));
  EXPECT_EQ(batch(4).ab.sizes(), (std::vector<std::int64_t>{3, 2, 8, 8}));
}

TEST(Merit, IsBalancedAucUnlessRawAucOrRmseFallShort) {
  const ChromaScore grey{88, 60, 10, 0, 30};
  EXPECT_DOUBLE_EQ(merit({90, 67, 8, 20, 30}, grey), 7);
  EXPECT_NEAR(merit({90, 67, 8.4, 20, 30}, grey), 7 - 2, 1e-9);
  EXPECT_NEAR(merit({88.5, 67, 8, 20, 30}, grey), 7 - 2, 1e-9);
}

TEST(ScoreGrey, IsTheBaseline) {
  RgbImage image{16, 16, {}};
  for (int i = 0; i < 16 * 16 * 3; ++i) image.rgb.push_back(std::uint8_t((i * 37) % 256));
  const SoftLabelTable table(torch::kCPU);
  const ChromaScore grey = score_grey({image}, table, torch::kCPU),
                    baseline = score_baselines({image}, table, torch::kCPU).grey;
  EXPECT_EQ(grey.rmse, baseline.rmse);
  EXPECT_EQ(grey.balanced_auc, baseline.balanced_auc);
  EXPECT_GT(grey.rmse, 0);
}

TEST(LabFromSrgb, GreyHasNoColorAndRedIsRed) {
  const torch::Tensor grey = lab_from_srgb(torch::full({1, 3, 1, 1}, 0.5)).ab;
  EXPECT_LT(grey.abs().max().item<float>(), 1e-3f);
  const LabPlanes red = lab_from_srgb(torch::tensor({1.0f, 0.0f, 0.0f}).view({1, 3, 1, 1}));
  EXPECT_NEAR(red.lightness.item<float>(), 53.24f, 0.02f);
  EXPECT_NEAR(red.ab[0][0].item<float>(), 80.09f, 0.05f);
  const torch::Tensor back = srgb_from_lab(red.lightness, red.ab);
  EXPECT_NEAR(back[0][0].item<float>(), 1, 1e-3f);
  EXPECT_NEAR(back[0][1].item<float>(), 0, 1e-2f);
}

TEST(TarReader, ReadsWhatIsThereAndRefusesTheRest) {
  const test::TempDir folder;
  write_file(folder / "bad.tar", std::string(1024, 'x'));
  EXPECT_THROW((void)read_tar_or_folder(folder / "bad.tar"), InputError);
  EXPECT_THROW((void)read_tar_or_folder(folder / "none.tar"), MissingInputError);
  write_file(folder / "set/b.txt", std::string_view("bb"));
  write_file(folder / "set/a/x.txt", std::string_view("a"));
  const auto entries = read_tar_or_folder(folder / "set");
  ASSERT_EQ(entries.size(), 2u);
  EXPECT_EQ(entries[0].name, "a/x.txt");
  EXPECT_EQ(entries[1].content.size(), 2u);
}

TEST(RgbImage, ResizingKeepsTheMean) {
  RgbImage image{9, 6, {}};
  for (int i = 0; i < 9 * 6 * 3; ++i) image.rgb.push_back(std::uint8_t((i * 37) % 256));
  const auto mean = [](const RgbImage& of) {
    double sum = 0;
    for (const std::uint8_t value : of.rgb) sum += value;
    return sum / double(of.rgb.size());
  };
  EXPECT_NEAR(mean(resize_image(image, 3, 2)), mean(image), 6);
  EXPECT_NEAR(mean(resize_image(image, 27, 18)), mean(image), 3);
  EXPECT_EQ(resize_image(image, 9, 6).rgb, image.rgb);
}

}  // namespace
}  // namespace cnerf
