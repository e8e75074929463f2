#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/color/ab_bins.h"
#include "src/colorizer/torch/encoder.h"
#include "src/colorizer/torch/lab_tensors.h"
#include "src/colorizer/torch/network_weights.h"
#include "src/colorizer_training/score.h"
#include "src/colorizer_training/trainer.h"
#include "src/picture/encode.h"
#include "tests/colorizer/made_model.h"
#include "tests/support/data.h"

namespace cnerf::colorizer_training {
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
  options.warmup_steps = 5;
  return options;
}

TEST(ColorizerTrainer, LearnsATinySet) {
  const ImageSet set = tiny_set();
  ColorizerTrainer trainer(set, {}, tiny_options(), torch::kCPU);
  const auto mean_loss = [&](int steps) {
    double sum = 0;
    for (int i = 0; i < steps; ++i) sum += trainer.step().classification.item<double>();
    return sum / steps;
  };
  const double before = mean_loss(4);
  (void)mean_loss(20);
  EXPECT_LT(mean_loss(4), 0.8 * before);
}

TEST(ColorizerTrainer, TheLargeNetworkLearnsByWhatItsEncoderSees) {
  const test::TempDir folder;
  test::small_resnet().write(folder.path());
  const ImageSet set = tiny_set();
  FrozenNetworks frozen;
  frozen.encoder = load_encoder(folder.path());
  ColorizerTrainer trainer(set, std::move(frozen), tiny_options(), torch::kCPU);
  for (int i = 0; i < 3; ++i) trainer.step();
  for (const char* stage : {"see4", "see8", "see16", "see32"}) {
    // One at first, and without weight decay: nothing but a gradient changes it.
    const torch::Tensor scale = trainer.averaged()->named_parameters()[std::string(stage) + ".norm.weight"];
    EXPECT_TRUE((scale != 1).any().item<bool>()) << stage;
  }
}

/// A network that answers `bin` everywhere.
ColorizerNet one_bin_network(int bin) {
  const torch::NoGradGuard no_grad;
  ColorizerNet network(Normalisation::kFolded);
  network->eval();
  torch::Tensor offsets = torch::zeros({kAbBinCount});
  offsets[bin] = 50;
  network->shift_logits(offsets);
  return network;
}

TEST(ColorizerTrainer, ADistilledNetworksAnswersAreLearnedByTheirShare) {
  constexpr int kBin = 40;
  const ImageSet set = tiny_set();
  struct Learned {
    double bin, truth;  ///< probability, and the last classification loss
  };
  const auto learned = [&](double distilled_share) -> Learned {
    TrainerOptions options = tiny_options();
    options.distilled_share = distilled_share;
    FrozenNetworks frozen;
    frozen.distilled = {one_bin_network(kBin)};
    ColorizerTrainer trainer(set, std::move(frozen), options, torch::kCPU);
    double truth = 0;
    for (int i = 0; i < 20; ++i) truth = trainer.step().classification.item<double>();
    const torch::NoGradGuard no_grad;
    const torch::Tensor logits = trainer.averaged()->forward(torch::full({1, 1, 32, 32}, 50.0f));
    return {torch::softmax(logits, 1).mean({0, 2, 3})[kBin].item<double>(), truth};
  };
  const Learned all = learned(1), none = learned(0);
  EXPECT_GT(all.bin, 5 * none.bin);
  EXPECT_GT(all.truth, 1.2 * none.truth) << "the truth is not learned";
}

TEST(ColorizerTrainer, BeginsWithGivenWeights) {
  constexpr int kBin = 40;
  const ImageSet set = tiny_set();
  FrozenNetworks frozen;
  frozen.start = one_bin_network(kBin);
  ColorizerTrainer trainer(set, std::move(frozen), tiny_options(), torch::kCPU);
  const auto probability = [&] {
    const torch::NoGradGuard no_grad;
    const torch::Tensor logits = fold_batch_norm(trainer.averaged())->forward(torch::full({1, 1, 32, 32}, 50.0f));
    return torch::softmax(logits, 1).mean({0, 2, 3})[kBin].item<double>();
  };
  EXPECT_GT(probability(), 0.999);
  const double first = trainer.step().classification.item<double>();
  double last = first;
  for (int i = 0; i < 20; ++i) last = trainer.step().classification.item<double>();
  EXPECT_LT(last, 0.8 * first);
  EXPECT_LT(probability(), 0.999) << "the start is not changed";
}

TEST(DistillationLoss, IsLeastWhereTheAnswersAreTheSame) {
  torch::manual_seed(4);
  const torch::Tensor taught = torch::randn({2, kAbBinCount, 3, 5});
  torch::Tensor logits = (taught + torch::randn({2, 1, 3, 5})).requires_grad_();  // the same distribution
  distillation_loss(logits, {taught}).backward();
  EXPECT_LT(logits.grad().abs().max().item<float>(), 1e-7f);
  const torch::Tensor p = torch::softmax(taught, 1);
  EXPECT_NEAR(distillation_loss(logits, {taught}).item<double>(), -(p * p.log()).sum(1).mean().item<double>(), 1e-4);
}

TEST(DistillationLoss, TeachesTheMeanOfSeveralNetworks) {
  torch::manual_seed(5);
  const std::vector<torch::Tensor> taught = {torch::randn({2, kAbBinCount, 3, 5}),
                                             torch::randn({2, kAbBinCount, 3, 5})};
  const torch::Tensor mean = (torch::softmax(taught[0], 1) + torch::softmax(taught[1], 1)) / 2;
  torch::Tensor logits = mean.log().requires_grad_();
  distillation_loss(logits, taught).backward();
  EXPECT_LT(logits.grad().abs().max().item<float>(), 1e-7f);
}

TEST(ColorizerTrainer, ContinuesBitForBit) {
  const test::TempDir folder;
  const ImageSet set = tiny_set();
  ColorizerTrainer straight(set, {}, tiny_options(), torch::kCPU);
  for (int i = 0; i < 3; ++i) straight.step();
  straight.save(folder / "checkpoint.pt");
  const double expected = (straight.step(), straight.step()).classification.item<double>();

  ColorizerTrainer resumed(set, {}, tiny_options(), torch::kCPU);
  resumed.load(folder / "checkpoint.pt");
  EXPECT_EQ(resumed.steps_done(), 3);
  EXPECT_EQ((resumed.step(), resumed.step()).classification.item<double>(), expected);
  const auto a = straight.averaged()->parameters(), b = resumed.averaged()->parameters();
  for (std::size_t i = 0; i < a.size(); ++i) ASSERT_TRUE(torch::equal(a[i], b[i]));
}

TEST(ColorizerTrainer, RefusesOtherCheckpoints) {
  const test::TempDir folder;
  const ImageSet set = tiny_set();
  ColorizerTrainer trainer(set, {}, tiny_options(), torch::kCPU);
  EXPECT_THROW(trainer.load(folder / "none.pt"), MissingInputError);
  write_file(folder / "short.pt", std::string_view("not a checkpoint"));
  EXPECT_THROW(trainer.load(folder / "short.pt"), SnapshotError);
}

TEST(ColorizerTrainer, GoesOnForTheStepsThatItBeganWith) {
  const test::TempDir folder;
  const ImageSet set = tiny_set();
  ColorizerTrainer trainer(set, {}, tiny_options(), torch::kCPU);
  trainer.step();
  trainer.save(folder / "checkpoint.pt");
  TrainerOptions options = tiny_options();
  options.steps = 60;
  ColorizerTrainer other(set, {}, options, torch::kCPU);
  try {
    other.load(folder / "checkpoint.pt", 60);
    FAIL() << "60 steps were asked for, and it would make 40";
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), testing::AllOf(testing::HasSubstr("--steps 60"), testing::HasSubstr("40 steps")));
  }
  EXPECT_EQ(other.steps_done(), 0);
  other.load(folder / "checkpoint.pt", 40);
  EXPECT_EQ(other.steps_done(), 1);
  EXPECT_EQ(other.total_steps(), 40);
}

TEST(LoadImageSet, TellsEvaluationFoldersApartByTheirNames) {
  const test::TempDir folder;
  ImageSources sources;
  for (const char* name : {"a/birds", "b/fish"}) {
    write_png(folder / name / "1.png", {8, 8, std::vector<std::uint8_t>(192, 99)});
    sources.evaluation.push_back(folder / name);
  }
  EXPECT_EQ(load_image_set(sources).evaluation.size(), 2u);
  write_png(folder / "c/birds" / "1.png", {8, 8, std::vector<std::uint8_t>(192, 99)});
  sources.evaluation.push_back(folder / "c/birds");
  EXPECT_THROW((void)load_image_set(sources), UsageError);
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
  const auto batch = [&](std::int64_t step) { return make_batch({{&photos, 3}}, 32, 9, step); };
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

TEST(ScoreBaselines, NoConstantIsWorseThanGrey) {
  Picture image{16, 16, {}};
  for (int i = 0; i < 16 * 16 * 3; ++i) image.rgb.push_back(std::uint8_t((i * 37) % 256));
  const Baselines baselines = score_baselines({image}, SoftLabelTable(torch::kCPU));
  EXPECT_GT(baselines.grey.rmse, 0);
  EXPECT_LE(baselines.best_constant.rmse, baselines.grey.rmse);
  EXPECT_GE(baselines.best_constant.balanced_auc, baselines.grey.balanced_auc);
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

TEST(LoadImageSet, CutsMosaicsIntoLabelledTilesAndRefusesWhatIsNoPicture) {
  const test::TempDir folder;
  Picture mosaic{32, 16, {}};  // a dark tile beside a bright one
  for (int i = 0; i < 32 * 16 * 3; ++i) mosaic.rgb.push_back(i / 3 % 32 < 16 ? 20 : 200);
  std::filesystem::create_directories(folder / "mosaics");
  for (const char* name : {"b.png", "a.png"}) write_png(folder / "mosaics" / name, mosaic);
  std::string labels("\x93NUMPY\1\0\x76\0", 10);
  labels += "{'descr': '|u1', 'fortran_order': False, 'shape': (4,), }";
  labels.resize(128, ' ');
  write_file(folder / "labels.npy", labels + std::string({4, 1, 2, 3}));
  ImageSources sources;
  sources.mosaics = {folder / "mosaics"};
  sources.mosaic_labels = folder / "labels.npy";
  sources.tile_side = 16;
  const ImageSet set = load_image_set(sources);
  const auto held_out = set.validation.contains("objects") ? set.validation.at("objects").size() : 0;
  ASSERT_EQ(set.tiles.size() + held_out, 4u);
  EXPECT_EQ(set.classes.names.size(), 5u);
  for (std::size_t i = 0; i < set.tiles.size(); ++i) {
    const int shade = set.tiles.rgb[i * 16 * 16 * 3];
    EXPECT_EQ(shade == 20, set.tiles.label[i] % 2 == 0) << "a tile's label went to its neighbour";
  }

  write_file(folder / "mosaics/c.png", std::string_view("no picture"));
  EXPECT_THROW((void)load_image_set(sources), InputError);
  sources.mosaics = {folder / "none"};
  EXPECT_THROW((void)load_image_set(sources), MissingInputError);
}

TEST(Resized, KeepsTheMean) {
  Picture image{9, 6, {}};
  for (int i = 0; i < 9 * 6 * 3; ++i) image.rgb.push_back(std::uint8_t((i * 37) % 256));
  const auto mean = [](const Picture& of) {
    double sum = 0;
    for (const std::uint8_t value : of.rgb) sum += value;
    return sum / double(of.rgb.size());
  };
  EXPECT_NEAR(mean(resized(image, 3, 2)), mean(image), 6);
  EXPECT_NEAR(mean(resized(image, 27, 18)), mean(image), 3);
  EXPECT_EQ(resized(image, 9, 6).rgb, image.rgb);
}

}  // namespace
}  // namespace cnerf::colorizer_training
