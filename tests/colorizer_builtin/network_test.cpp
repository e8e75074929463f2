#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/torch.h>
#include <torch/version.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/process.h"
#include "src/colorizer/kinds.h"
#include "src/colorizer/torch/encoder.h"
#include "src/colorizer/torch/network_weights.h"
#include "src/colorizer/torch/products.h"
#include "src/colorizer_training/score.h"
#include "tests/colorizer/made_model.h"
#include "tests/support/data.h"
#include "tests/support/message_of.h"

namespace cnerf {
namespace {

using namespace colorizer_training;

using torch::Tensor;

constexpr std::int64_t kMostParameters = 6'500'000;
constexpr std::uintmax_t kMostBytes = 13'000'000;

std::unique_ptr<Colorizer> builtin_colorizer() {
  return make_builtin_colorizer({"", ColorizerOptions{}, ColorizerContext{}});
}

Tensor random_lightness(std::int64_t batch, std::int64_t height, std::int64_t width) {
  torch::manual_seed(3);
  return 100 * torch::rand({batch, 1, height, width});
}

/// Batch normalisation with statistics that are not the identity, so that folding has something to do.
ColorizerNet trained_like_network(const std::shared_ptr<const Encoder>& encoder = nullptr) {
  torch::manual_seed(5);
  ColorizerNet network(Normalisation::kBatch, encoder);
  const torch::NoGradGuard no_grad;
  for (auto& item : network->named_buffers()) {
    if (item.key().ends_with("running_mean")) item.value().normal_(0, 0.1);
    if (item.key().ends_with("running_var")) item.value().uniform_(0.5, 2);
  }
  network->eval();
  return network;
}

TEST(ColorizerNet, StaysWithinItsSize) {
  EXPECT_LE(parameter_count(*ColorizerNet()), kMostParameters);
  EXPECT_LE(parameter_count(*ColorizerNet(Normalisation::kFolded)), kMostParameters);
}

TEST(ColorizerNet, RefusesSidesItWouldHaveToPad) {
  ColorizerNet network(Normalisation::kFolded);
  EXPECT_THROW((void)network->forward(random_lightness(1, 32, 40)), ContractError);
  EXPECT_THROW((void)network->forward(random_lightness(1, 40, 32)), ContractError);
}

TEST(AskNetwork, BringsThePictureToTheSideAskedAt) {
  const torch::NoGradGuard no_grad;
  ColorizerNet network(Normalisation::kFolded);
  network->eval();
  struct Case {
    int height, width, short_side, expected_height, expected_width;
  };
  for (const Case& c : {Case{64, 64, 64, 64, 64}, Case{64, 96, 128, 128, 192}, Case{200, 130, 64, 96, 64},
                        Case{1, 100, 256, 32, 2048}, Case{33, 50, 64, 64, 96}}) {
    const Tensor logits = ask_network(network, random_lightness(2, c.height, c.width), c.short_side);
    EXPECT_EQ(logits.sizes(), (std::vector<std::int64_t>{2, 313, c.expected_height / 4, c.expected_width / 4}))
        << c.height << " x " << c.width;
  }
  const Tensor untouched = random_lightness(1, 64, 96);
  EXPECT_TRUE(torch::equal(ask_network(network, untouched, 64), network->forward(untouched)));
}

TEST(ColorizeLightness, AnswersAtThePicturesOwnSize) {
  const torch::NoGradGuard no_grad;
  ColorizerNet network(Normalisation::kFolded);
  network->eval();
  for (const auto& [height, width] : {std::pair{32, 32}, {33, 50}, {7, 129}, {150, 100}}) {
    const Tensor ab = colorize_lightness(network, random_lightness(2, height, width), {1, 1, 64});
    EXPECT_EQ(ab.sizes(), (std::vector<std::int64_t>{2, 2, height, width}));
    EXPECT_TRUE(torch::isfinite(ab).all().item<bool>());
  }
}

TEST(ColorizerNet, FoldingChangesNothing) {
  const torch::NoGradGuard no_grad;
  ColorizerNet trained = trained_like_network();
  ColorizerNet folded = fold_batch_norm(trained);
  const Tensor input = random_lightness(1, 64, 64);
  const Tensor expected = trained->forward(input), actual = folded->forward(input);
  EXPECT_LT((expected - actual).abs().max().item<float>(), 1e-3f * expected.abs().max().item<float>());
  EXPECT_GT((expected - ColorizerNet(Normalisation::kFolded)->forward(input)).abs().max().item<float>(), 1e-2f)
      << "the comparison must be able to fail";
}

LightnessBatch ramp_batch(int batch, int height, int width) {
  LightnessBatch patches{batch, height, width, {}};
  for (int i = 0; i < batch * height * width; ++i) patches.lightness.push_back(float((i * 7 + i / width) % 101));
  return patches;
}

/// A small encoder that is the installed one while this lives; afterwards none is.
class InstalledEncoder {
 public:
  explicit InstalledEncoder(std::uint64_t seed = 2) {
    test::small_resnet(seed).write(folder_.path());
    ::setenv("CNERF_ENCODER", folder_.path().c_str(), 1);
    encoder = load_encoder(folder_.path());
  }
  ~InstalledEncoder() { ::setenv("CNERF_ENCODER", "/absent", 1); }  // not one that this machine may have
  InstalledEncoder(const InstalledEncoder&) = delete;
  InstalledEncoder& operator=(const InstalledEncoder&) = delete;

  std::shared_ptr<const Encoder> encoder;

 private:
  test::TempDir folder_;
};

TEST(LargeColorizerNet, AnswersByWhatItsEncoderSees) {
  const torch::NoGradGuard no_grad;
  const test::TempDir folder;
  test::small_resnet(9).write(folder.path());
  const InstalledEncoder installed;
  ColorizerNet large = fold_batch_norm(trained_like_network(installed.encoder));
  ColorizerNet other = fold_batch_norm(trained_like_network(load_encoder(folder.path())));
  const Tensor input = random_lightness(1, 64, 64), answer = large->forward(input);
  EXPECT_EQ(answer.sizes(), ColorizerNet()->forward(input).sizes());
  EXPECT_GT((answer - other->forward(input)).abs().max().item<float>(), 1e-2f);
  for (const char* stage : {"see4", "see8", "see16", "see32"}) {
    Tensor weight = large->named_parameters()[std::string(stage) + ".conv.weight"];
    weight.neg_();
    EXPECT_GT((answer - large->forward(input)).abs().max().item<float>(), 1e-2f) << stage;
    weight.neg_();
  }
}

TEST(LargeColorizerNet, FoldingChangesNothing) {
  const torch::NoGradGuard no_grad;
  const InstalledEncoder installed;
  ColorizerNet trained = trained_like_network(installed.encoder);
  const Tensor input = random_lightness(1, 64, 64), expected = trained->forward(input);
  const Tensor actual = fold_batch_norm(trained)->forward(input);
  EXPECT_LT((expected - actual).abs().max().item<float>(), 1e-3f * expected.abs().max().item<float>());
}

TEST(LargeColorizerNet, ComesBackOnlyBesideItsEncoder) {
  const torch::NoGradGuard no_grad;
  const test::TempDir folder;
  const auto load = [&] { return load_colorizer_weights(folder / "large.weights"); };
  {
    const InstalledEncoder installed;
    ColorizerNet folded = fold_batch_norm(trained_like_network(installed.encoder));
    save_colorizer_weights(folder / "large.weights", folded, {1, 1, 64});
    const Tensor input = random_lightness(1, 32, 32), expected = folded->forward(input);
    EXPECT_LT((expected - load().network->forward(input)).abs().max().item<float>(),
              0.02f * expected.abs().max().item<float>());
    const auto colorizer =
        make_builtin_colorizer({(folder / "large.weights").string(), ColorizerOptions{}, ColorizerContext{}});
    const LightnessBatch patches = ramp_batch(2, 32, 48);
    check_answer(colorizer->name(), patches, colorizer->colorize(patches));
  }
  EXPECT_THAT(test::message_of<MissingInputError>(load),
              testing::AllOf(testing::HasSubstr("large.weights"), testing::HasSubstr("/absent"),
                             testing::HasSubstr("--encoder")));
  const InstalledEncoder another(9);
  EXPECT_THAT(test::message_of<InputError>(load),
              testing::AllOf(testing::HasSubstr("large.weights"), testing::HasSubstr(another.encoder->sha256())));
}

TEST(GuidedUpsample, KeepsConstantsAndStopsAtEdges) {
  Tensor lightness = torch::full({1, 1, 32, 32}, 20.0f);
  lightness.slice(3, 16, 32).fill_(80);
  const Tensor flat = torch::full({1, 2, 8, 8}, 7.0f);
  EXPECT_LT((guided_upsample(flat, lightness) - 7).abs().max().item<float>(), 1e-4f);

  Tensor halves = torch::zeros({1, 2, 8, 8});
  halves.slice(3, 4, 8).fill_(50);
  const Tensor full = guided_upsample(halves, lightness);
  EXPECT_LT(full.slice(3, 0, 16).max().item<float>(), 1.0f);  // a plain bilinear would give 18 beside the edge
  EXPECT_GT(full.slice(3, 16, 32).min().item<float>(), 49.0f);
}

TEST(GuidedUpsample, CellsNeedNotDivideThePicture) {
  torch::manual_seed(7);
  // A ramp over the cells' columns, where lightness says nothing: a spline repeats it.
  const Tensor ramp = torch::arange(7).to(torch::kFloat32).view({1, 1, 1, 7}).expand({1, 1, 5, 7}).contiguous();
  for (const auto& size : {std::pair{33, 50}, {5, 7}, {3, 4}}) {
    const int height = size.first, width = size.second;  // no structured binding: clang 14 captures none
    const Tensor full = guided_upsample(ramp, torch::full({1, 1, height, width}, 50.0f));
    ASSERT_EQ(full.sizes(), (std::vector<std::int64_t>{1, 1, height, width}));
    const Tensor expected = (torch::arange(width) + 0.5) * 7 / width - 0.5;
    const auto inside = [&](const Tensor& x) { return x.slice(-1, (width + 6) / 7, width - (width + 6) / 7); };
    EXPECT_LT((inside(full) - inside(expected)).abs().max().item<float>(), 1e-3f) << width;
    EXPECT_GE(full.min().item<float>(), 0);
    EXPECT_LE(full.max().item<float>(), 6);
  }
}

TEST(ColorizerWeights, ComeBackAsHalfPrecision) {
  const torch::NoGradGuard no_grad;
  const test::TempDir folder;
  ColorizerNet folded = fold_batch_norm(trained_like_network());
  save_colorizer_weights(folder / "net.weights", folded, {0.7, 1.15, 224});
  EXPECT_LE(std::filesystem::file_size(folder / "net.weights"), kMostBytes);

  ColorizerWeights loaded = load_colorizer_weights(folder / "net.weights");
  EXPECT_EQ(loaded.decoding.temperature, 0.7);
  EXPECT_EQ(loaded.decoding.gain, 1.15);
  EXPECT_EQ(loaded.decoding.short_side, 224);
  const Tensor input = random_lightness(1, 32, 32);
  const Tensor expected = folded->forward(input), actual = loaded.network->forward(input);
  EXPECT_LT((expected - actual).abs().max().item<float>(), 0.02f * expected.abs().max().item<float>());
}

TEST(ColorizerWeights, DamageIsRefusedWithTheFileNamed) {
  const test::TempDir folder;
  save_colorizer_weights(folder / "net.weights", ColorizerNet(Normalisation::kFolded), {});
  const std::vector<std::byte> good = read_binary_file(folder / "net.weights");
  const auto refusal = [&](std::vector<std::byte> content) -> std::string {
    write_file(folder / "bad.weights", content);
    try {
      (void)load_colorizer_weights(folder / "bad.weights");
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  std::vector<std::byte> flipped = good;
  flipped[good.size() / 2] ^= std::byte{1};
  EXPECT_THAT(refusal(flipped), testing::AllOf(testing::HasSubstr("bad.weights"), testing::HasSubstr("checksum")));
  EXPECT_THAT(refusal({good.begin(), good.begin() + 1000}), testing::HasSubstr("bad.weights"));
  EXPECT_THAT(refusal({good.begin(), good.begin() + 4}), testing::HasSubstr("bad.weights"));
  EXPECT_THAT(refusal({}), testing::HasSubstr("bad.weights"));
  EXPECT_THROW((void)load_colorizer_weights(folder / "none.weights"), MissingInputError);
}

TEST(ColorizerWeights, NumbersThatAreNotFiniteAreRefused) {
  const torch::NoGradGuard no_grad;
  const test::TempDir folder;
  ColorizerNet network(Normalisation::kFolded);
  network->parameters()[0].fill_(std::numeric_limits<float>::quiet_NaN());
  save_colorizer_weights(folder / "net.weights", network, {});
  try {
    (void)load_colorizer_weights(folder / "net.weights");
    ADD_FAILURE() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::AllOf(testing::HasSubstr("net.weights"), testing::HasSubstr("finite")));
  }
}

TEST(ColorizerWeights, ASideNoPictureHasIsRefused) {
  const test::TempDir folder;
  for (const int side : {0, 5000}) {
    save_colorizer_weights(folder / "net.weights", ColorizerNet(Normalisation::kFolded), {1, 1, side});
    try {
      (void)load_colorizer_weights(folder / "net.weights");
      ADD_FAILURE() << "accepted " << side;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr("short side"));
      EXPECT_THAT(error.what(), testing::HasSubstr(std::to_string(side)));
    }
  }
}

TEST(BuiltinColorizer, AnswersFiniteColorsOfTheRightShape) {
  const auto colorizer = builtin_colorizer();
  EXPECT_THAT(colorizer->name(), testing::StartsWith("builtin"));
  for (const auto& [batch, height, width] : {std::tuple{1, 128, 128}, {9, 32, 48}, {2, 33, 31}}) {
    const LightnessBatch patches = ramp_batch(batch, height, width);
    check_answer(colorizer->name(), patches, colorizer->colorize(patches));
  }
  EXPECT_TRUE(colorizer->colorize({0, 16, 16, {}}).ab.empty());
}

TEST(BuiltinColorizer, AnswerDoesNotDependOnTheRestOfTheBatch) {
  const auto colorizer = builtin_colorizer();
  const LightnessBatch all = ramp_batch(3, 32, 32);
  LightnessBatch last{1, 32, 32, {all.lightness.begin() + 2 * 32 * 32, all.lightness.end()}};
  const ChromaBatch together = colorizer->colorize(all), alone = colorizer->colorize(last);
  for (std::size_t i = 0; i < alone.ab.size(); ++i) ASSERT_NEAR(alone.ab[i], together.ab[4 * 32 * 32 + i], 0.05f);
  for (std::size_t i = 0; i < alone.certainty.size(); ++i) {
    ASSERT_NEAR(alone.certainty[i], together.certainty[2 * 32 * 32 + i], 1e-4f);
  }
}

/// Soft blobs on [0, 1]^2, sampled at the pixels' centres.
LightnessBatch blobs(int side) {
  LightnessBatch picture{1, side, side, {}};
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const double u = (x + 0.5) / side, v = (y + 0.5) / side;
      picture.lightness.push_back(float(50 + 25 * std::sin(9 * u + 4 * v) * std::cos(7 * v) + 20 * v));
    }
  }
  return picture;
}

TEST(BuiltinColorizer, AnswerDoesNotDependOnThePicturesResolution) {
  const auto colorizer = builtin_colorizer();
  const std::vector<float> coarse = colorizer->colorize(blobs(96)).ab, fine = colorizer->colorize(blobs(288)).ab;
  double difference = 0, chroma = 0;
  for (int channel = 0; channel < 2; ++channel) {
    for (int y = 0; y < 96; ++y) {
      for (int x = 0; x < 96; ++x) {
        const float a = coarse[std::size_t((channel * 96 + y) * 96 + x)];
        const float b = fine[std::size_t((channel * 288 + 3 * y + 1) * 288 + 3 * x + 1)];  // the same centre
        difference += std::abs(a - b), chroma += std::abs(b);
      }
    }
  }
  EXPECT_GT(chroma, 96 * 96) << "the comparison must be able to fail";
  EXPECT_LT(difference, 0.1 * chroma);
}

/// A question of stage 2.
std::vector<float> asked_as(Colorizer& colorizer, std::uint64_t query) {
  LightnessBatch patch = blobs(96);
  patch.origins = {{"view", 0, 0, 1, 1, query}};
  return colorizer.colorize(patch).ab;
}

/// What is answered, in all ways of asking.
const std::set<std::vector<float>>& all_answers() {
  static const std::set<std::vector<float>> all = [] {
    const auto colorizer = builtin_colorizer();
    std::set<std::vector<float>> answers;
    for (std::uint64_t query = 0; query < 64; ++query) answers.insert(asked_as(*colorizer, query));
    return answers;
  }();
  return all;
}

TEST(BuiltinColorizer, AQuestionsNumberSaysHowItIsAsked) {
  const auto colorizer = builtin_colorizer();
  EXPECT_EQ(asked_as(*colorizer, 7), asked_as(*colorizer, 7));
  EXPECT_EQ(all_answers().size(), 8u) << "four sizes, each as it is and mirrored";
}

TEST(BuiltinColorizer, APictureGetsTheMeanOfAllWays) {
  const auto colorizer = builtin_colorizer();
  const double gain = load_colorizer_weights(builtin_weights_file()).decoding.gain;
  const std::set<std::vector<float>>& answers = all_answers();
  const std::vector<float> whole = colorizer->colorize(blobs(96)).ab;
  for (std::size_t i = 0; i < whole.size(); ++i) {
    double mean = 0;
    for (const std::vector<float>& answer : answers) mean += answer[i] / double(answers.size());
    ASSERT_NEAR(whole[i], gain * mean, 1e-3);
  }
}

TEST(BuiltinColorizer, AMirroredPictureGetsMirroredColors) {
  const auto colorizer = builtin_colorizer();
  LightnessBatch picture = blobs(64);
  const std::vector<float> ab = colorizer->colorize(picture).ab;
  for (int y = 0; y < 64; ++y) std::reverse(&picture.lightness[64 * y], &picture.lightness[64 * y] + 64);
  const std::vector<float> mirrored = colorizer->colorize(picture).ab;
  for (int row = 0; row < 128; ++row) {
    for (int x = 0; x < 64; ++x) ASSERT_NEAR(ab[64 * row + x], mirrored[64 * row + 63 - x], 1e-2);
  }
}

// Settings of stage 2 are made for certainties of this meaning: one over the number of equally likely colours.
TEST(BuiltinColorizer, SaysHowSureItIs) {
  const auto colorizer = builtin_colorizer();
  LightnessBatch picture = blobs(64);
  const std::vector<float> certainty = colorizer->colorize(picture).certainty;
  ASSERT_EQ(certainty.size(), 64u * 64);
  const auto [least, most] = std::ranges::minmax(certainty);
  EXPECT_GE(least, 1.0f / kAbBinCount);
  EXPECT_LT(most, 0.5f) << "soft labels of five bins are taught";
  EXPECT_GT(most, 1.05f * least) << "it is not everywhere as sure";
  for (int y = 0; y < 64; ++y) std::reverse(&picture.lightness[64 * y], &picture.lightness[64 * y] + 64);
  const std::vector<float> mirrored = colorizer->colorize(picture).certainty;
  for (int i = 0; i < 64 * 64; ++i) ASSERT_NEAR(certainty[i], mirrored[i / 64 * 64 + 63 - i % 64], 1e-5);
}

TEST(CertaintyMap, IsOneOverTheNumberOfEquallyLikelyColors) {
  torch::Tensor logits = torch::full({1, kAbBinCount, 1, 2}, 4.0);
  logits.select(3, 1).slice(1, 3) = -1e6;  // three are left
  const torch::Tensor certainty = certainty_map(logits);
  EXPECT_EQ(certainty.sizes(), (std::vector<std::int64_t>{1, 1, 1, 2}));
  EXPECT_NEAR(certainty[0][0][0][0].item<float>(), 1.0 / kAbBinCount, 1e-6);
  EXPECT_NEAR(certainty[0][0][0][1].item<float>(), 1.0 / 3, 1e-6);
}

TEST(BuiltinColorizer, OneDnn2IsAskedToLeaveAmx) {
  if (TORCH_VERSION_MAJOR >= 2) GTEST_SKIP() << "LibTorch has a later oneDNN";
  (void)product_type();
  EXPECT_STREQ(std::getenv("ONEDNN_MAX_CPU_ISA"), "AVX512_CORE_BF16");
}

TEST(BuiltinColorizer, FlatGreyGetsNearlyNoColor) {
  const auto colorizer = builtin_colorizer();
  const LightnessBatch flat{1, 64, 64, std::vector<float>(64 * 64, 55.0f)};
  const std::vector<float> ab = colorizer->colorize(flat).ab;
  for (const float value : ab) ASSERT_LT(std::abs(value), 40.0f);
}

/// The pictures of an archive.
std::vector<Picture> kodak_pictures(const std::filesystem::path& archive) {
  const test::TempDir folder;
  std::filesystem::create_directory(folder / "images");
  EXPECT_EQ(run_program({"tar", "-xf", archive.string(), "-C", (folder / "images").string()}, folder / "log"), 0);
  return load_evaluation_images(folder / "images");
}

TEST(BuiltinColorizer, BeatsGreyOnPhotographsItNeverSaw) {
  CNERF_REQUIRE_DATA(kodak, "colorizer/eval-kodak-384px.tar");
  std::vector<Picture> images = kodak_pictures(kodak);
  images.resize(8);
  const SoftLabelTable table(torch::kCPU);
  ColorizerWeights weights = load_colorizer_weights(builtin_weights_file());
  const ChromaScore score = score_network(weights.network, images, {{0, weights.decoding}}, {}, table)[0];
  const ChromaScore grey = score_baselines(images, table).grey;
  EXPECT_GT(score.balanced_auc, grey.balanced_auc + 3);
  EXPECT_LT(score.rmse, 0.9 * grey.rmse);
}

TEST(Score, GreyOnKodakIsWhatOthersMeasure) {
  CNERF_REQUIRE_DATA(kodak, "colorizer/eval-kodak-384px.tar");
  const ChromaScore grey = score_baselines(kodak_pictures(kodak), SoftLabelTable(torch::kCPU)).grey;
  EXPECT_NEAR(grey.rmse, 15.34, 0.2);  // an independent measurement at the same size, by another resize filter
  EXPECT_NEAR(grey.raw_auc, 88.65, 0.3);
}

}  // namespace
}  // namespace cnerf
