// The reader of TensorFlow.js models, against a small one that is made here, and the network that is read from it.

#include <gtest/gtest.h>
#include <torch/torch.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "src/base/files.h"
#include "src/base/parallel.h"
#include "src/color/colorspace_math.h"
#include "src/colorizer/torch/encoder.h"
#include "src/colorizer/torch/reference_images.h"
#include "src/colorizer/torch/reference_network.h"
#include "tests/colorizer/made_model.h"
#include "tests/colorizer/questions.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

using nlohmann::json;
using test::MadeModel;
using test::message_of;
using test::small_resnet;
using ::testing::AllOf;
using ::testing::HasSubstr;
using torch::Tensor;

MadeModel one_conv() {
  torch::manual_seed(1);
  MadeModel made;
  made.conv("conv", "norm", {3, 3, 2, 5});
  return made;
}

/// Convolution, then normalisation, as they stand in the model: nothing is folded.
Tensor unfolded(const MadeModel& made, const Tensor& x, const std::string& conv, const std::string& norm, int stride) {
  const Tensor kernel = made.get(conv + "/kernel");
  const Tensor y =
      torch::conv2d(x, kernel.permute({3, 2, 0, 1}).contiguous(), made.get(conv + "/bias"), stride, kernel.size(0) / 2);
  return torch::batch_norm(y, made.get(norm + "/gamma"), made.get(norm + "/beta"), made.get(norm + "/moving_mean"),
                           made.get(norm + "/moving_variance"), false, 0, 1e-3, false);
}

TEST(LayersModel, ReadsWeightsAcrossShardsInTheirOrder) {
  const test::TempDir folder;
  MadeModel made = one_conv();
  made.shard = 7;  // no shard ends where a weight does
  made.write(folder.path());
  const LayersModel model = read_layers_model(folder.path());
  EXPECT_EQ(model.weights.size(), 6U);
  EXPECT_TRUE(tensor_of(model, "conv/kernel", {3, 3, 2, 5}).equal(made.get("conv/kernel")));
  EXPECT_TRUE(tensor_of(model, "norm/beta", {5}).equal(made.get("norm/beta")));
  EXPECT_EQ(model.epsilon_of("norm"), 0.001);
}

TEST(LayersModel, AFoldedConvolutionIsTheConvolutionAndItsNormalisation) {
  const test::TempDir folder;
  const MadeModel made = one_conv();
  made.write(folder.path());
  const FoldedConv folded = folded_conv(read_layers_model(folder.path()), "conv", "norm", {3, 3, 2, 5});
  const Tensor x = torch::randn({2, 2, 9, 12}), expected = unfolded(made, x, "conv", "norm", 1);
  // Float sums of 18 products of about 1.
  EXPECT_LT((folded(x) - expected).abs().max().item<float>(), 1e-5 * expected.abs().max().item<float>());
}

TEST(LayersModel, RefusesWhatIsDamagedByName) {
  const test::TempDir folder;
  const auto refusal = [&](const MadeModel& made) {
    made.write(folder.path());
    return message_of<InputError>([&] {
      (void)folded_conv(read_layers_model(folder.path()), "conv", "norm", {3, 3, 2, 5});
    });
  };
  MadeModel made = one_conv();
  made.changed = {{"format", "graph-model"}};
  EXPECT_THAT(refusal(made), AllOf(HasSubstr("model.json"), HasSubstr("format"), HasSubstr("graph-model")));
  made = one_conv();
  made.weights[0].first = "other/kernel";
  EXPECT_THAT(refusal(made), AllOf(HasSubstr("model.json"), HasSubstr("conv/kernel"), HasSubstr("none")));
  made = one_conv();
  made.weights[0].second = torch::zeros({3, 3, 5, 2});
  EXPECT_THAT(refusal(made), AllOf(HasSubstr("conv/kernel"), HasSubstr("[3, 3, 5, 2]")));
  made = one_conv();
  made.get("norm/gamma")[2] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(refusal(made), AllOf(HasSubstr("norm/gamma"), HasSubstr("nan at 2")));
  made = one_conv();
  made.get("norm/moving_variance")[2] = -1;
  EXPECT_THAT(refusal(made), HasSubstr("norm/moving_variance"));
  made = one_conv();
  made.layers = json::array();
  EXPECT_THAT(refusal(made), AllOf(HasSubstr("model.json"), HasSubstr("norm")));
  made = one_conv();
  made.changed = json{{"weightsManifest", json::array({{{"paths", {"../x"}}, {"weights", json::array()}}})}};
  EXPECT_THAT(refusal(made), AllOf(HasSubstr("paths"), HasSubstr("../x")));
}

TEST(LayersModel, RefusesShardsOfAnotherSize) {
  const test::TempDir folder;
  one_conv().write(folder.path());
  const auto read = [&] { (void)read_layers_model(folder.path()); };
  const std::string shard = read_text_file(folder / "shard0.bin");
  write_file(folder / "shard0.bin", shard.substr(4));
  EXPECT_THAT(message_of<InputError>(read), AllOf(HasSubstr("model.json"), HasSubstr("norm/moving_variance")));
  write_file(folder / "shard0.bin", shard + "more");
  EXPECT_THAT(message_of<InputError>(read), AllOf(HasSubstr("weightsManifest"), HasSubstr("464")));
  std::filesystem::remove(folder / "shard0.bin");
  EXPECT_THAT(message_of<MissingInputError>(read), HasSubstr("shard0.bin"));
  std::filesystem::remove(folder / "model.json");
  EXPECT_THAT(message_of<MissingInputError>(read), HasSubstr("model.json"));
}

TEST(Encoder, IsTheNetworkOfItsModel) {
  const test::TempDir folder;
  const MadeModel made = small_resnet();
  made.write(folder.path());
  const Encoder encoder(read_layers_model(folder.path()));
  EXPECT_EQ(encoder.channels(), (std::vector<std::int64_t>{8, 16, 32, 64}));

  const float grey = 255 * srgb_from_linear(luminance_from_lightness(50.0f));
  EXPECT_NEAR(grey, 118.9f, 0.05f);
  const Tensor means = torch::tensor({103.939f, 116.779f, 123.68f}).view({1, 3, 1, 1});
  Tensor x = torch::full({1, 3, 64, 96}, grey) - means;
  x = torch::max_pool2d(torch::relu(unfolded(made, x, "conv1", "bn_conv1", 2)), 3, 2, 1);
  const std::vector<Tensor> stages = encoder.features(torch::full({1, 1, 64, 96}, 50.0f));
  const std::vector<std::string> names{"2abc", "3abcd", "4abcdef", "5abc"};
  for (std::size_t stage = 0; stage < names.size(); ++stage) {
    for (const char letter : names[stage].substr(1)) {
      const std::string name = std::string{names[stage][0], letter} + "_branch";
      const auto layer = [&](const Tensor& in, const std::string& branch, int stride) {
        return unfolded(made, in, "res" + name + branch, "bn" + name + branch, stride);
      };
      const int stride = letter == 'a' && stage > 0 ? 2 : 1;
      const Tensor inner = torch::relu(layer(torch::relu(layer(x, "2a", stride)), "2b", 1));
      x = torch::relu(layer(inner, "2c", 1) + (letter == 'a' ? layer(x, "1", stride) : x));
    }
    ASSERT_EQ(stages[stage].sizes(), x.sizes());
    // Rounding of sums in another order, through up to 53 layers.
    EXPECT_LT((stages[stage] - x).abs().max().item<float>(), 1e-4 * x.abs().max().item<float>()) << stage;
  }
}

TEST(Encoder, LooksAtPicturesInColourByTheirRegions) {
  const test::TempDir folder;
  small_resnet().write(folder.path());
  const Encoder encoder(read_layers_model(folder.path()));
  // Of its own size and one colour: blue first, as the training had it.
  const int width = 288, height = 224;
  std::vector<std::uint8_t> rgb;
  for (int i = 0; i < width * height; ++i) rgb.insert(rgb.end(), {118, 118, 118});
  const std::vector<float> regions = encoder.regions(rgb, width, height);
  ASSERT_EQ(regions.size(), 16U * 64);
  const float lightness = lightness_from_luminance(linear_from_srgb(118 / 255.0f));
  const Tensor last = encoder.features(torch::full({1, 1, height, width}, lightness)).back();
  const Tensor expected = torch::adaptive_avg_pool2d(last, {4, 4})[0].flatten(1).t();
  const Tensor found = torch::tensor(regions).view({16, 64});
  EXPECT_LT((found - expected).abs().max().item<float>(), 1e-3 * expected.abs().max().item<float>());

  std::vector<std::uint8_t> red = rgb, blue = rgb;
  for (std::size_t i = 0; i < rgb.size(); i += 3) red[i] = blue[i + 2] = 200;
  EXPECT_NE(encoder.regions(red, width, height), regions) << "colours are seen";
  EXPECT_NE(encoder.regions(red, width, height), encoder.regions(blue, width, height));
  EXPECT_EQ(encoder.regions(std::vector<std::uint8_t>(3 * 40 * 8, 90), 8, 40).size(), 16U * 64) << "of any size";
}

ReferenceRecipe six_steps(std::shared_ptr<const Encoder> encoder) {
  ReferenceRecipe recipe;
  recipe.steps = 6;
  recipe.channels = {16, 24, 32, 32};
  recipe.patch_size = 64;
  if (encoder) use_encoder(recipe, std::move(encoder));
  return recipe;
}

TEST(Encoder, AFitStartsAsItWouldWithoutItAndDoesNotDependOnThreads) {
  const test::TempDir folder;
  small_resnet().write(folder.path());
  cv::Mat picture(120, 160, CV_8UC3, cv::Scalar(30, 60, 180));
  cv::circle(picture, {60, 60}, 40, cv::Scalar(180, 60, 30), -1);
  cv::imwrite((folder / "picture.png").string(), picture);
  const std::vector<ReferenceImage> images{load_reference_image(folder / "picture.png")};
  const ReferenceRecipe alone = six_steps(nullptr), guided = six_steps(load_encoder(folder.path()));
  EXPECT_NE(alone.text(), guided.text()) << "a cached fit would be taken for another";
  const LightnessBatch question = test::some_question(2, 64, 96);
  EXPECT_EQ(ReferenceNetwork(guided, images, 3).colorize(question).ab,
            ReferenceNetwork(alone, images, 3).colorize(question).ab);

  const auto fitted = [&](int threads, std::uint64_t seed) {
    set_thread_count(threads);
    ReferenceNetwork network(guided, images, seed);
    network.fit(images, {});
    set_thread_count(0);
    return network.weights();
  };
  const std::vector<float> once = fitted(1, 5);
  EXPECT_EQ(once, fitted(4, 5));
  EXPECT_NE(once, fitted(1, 6));
}

TEST(Encoder, TheInstalledOneKnowsAGreyFox) {
  if (!is_encoder_installed()) GTEST_SKIP() << "needs the encoder in " << encoder_folder();
  CNERF_REQUIRE_DATA(fox, "scenes/fox/images");
  const LayersModel model = read_layers_model(encoder_folder());
  const Encoder encoder(model);
  EXPECT_EQ(encoder.channels(), (std::vector<std::int64_t>{256, 512, 1024, 2048}));
  // The head of the network, which the program has no use for.
  const Tensor kernel = tensor_of(model, "fc1000/kernel", {2048, 1000}), bias = tensor_of(model, "fc1000/bias", {1000});
  const ReferenceImage image = load_reference_image(std::filesystem::directory_iterator(fox)->path());
  const LabImage& level = image.levels[1];
  Tensor lightness = torch::empty({1, 1, level.height, level.width});
  for (std::int64_t i = 0; i < lightness.numel(); ++i) {
    lightness.data_ptr<float>()[i] = level.lab[std::size_t(i) * 3];
  }
  lightness = torch::upsample_bilinear2d(lightness, {320, 192}, false);
  const Tensor scores = encoder.features(lightness).back().mean({2, 3}).matmul(kernel) + bias;
  const auto best = scores.argmax().item<std::int64_t>();
  EXPECT_TRUE(best >= 277 && best <= 280) << "red, kit, Arctic or grey fox; found class " << best;
}

}  // namespace
}  // namespace cnerf
