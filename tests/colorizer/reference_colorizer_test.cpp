// reference: colorizers fitted to a toy scene in which the texture of a thing decides its colour.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "src/base/files.h"
#include "src/base/parallel.h"
#include "src/color/ab_bins.h"
#include "src/color/colorspace_math.h"
#include "src/colorizer/torch/network_weights.h"
#include "src/colorizer/torch/reference_images.h"
#include "src/colorizer/torch/reference_network.h"
#include "src/picture/exr_writer.h"
#include "tests/colorizer/questions.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

using test::message_of;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;

/// Discs of fine stripes are red, discs of coarse stripes are blue, the smooth ground is green; mean lightness is the
/// same everywhere, so nothing but texture tells. `seed` places the discs.
struct Toy {
  int side = 192;
  std::vector<float> linear_rgb;  ///< [H, W, 3]
  LightnessBatch question;
  std::vector<float> ab;  ///< [2, H, W]
};

Toy toy_scene(std::uint64_t seed) {
  Toy toy;
  SequentialRng rng(seed, 3);
  const int side = toy.side;
  const auto pixels = std::size_t(side * side);
  std::vector<int> kind(pixels, 0);
  for (int disc = 0; disc < 10; ++disc) {
    const float x0 = rng.uniform(0, float(side)), y0 = rng.uniform(0, float(side)), radius = rng.uniform(20, 34);
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) {
        if (std::hypot(float(x) - x0, float(y) - y0) < radius) kind[std::size_t(y * side + x)] = 1 + disc % 2;
      }
    }
  }
  constexpr float kColors[3][2] = {{-30, 25}, {40, 25}, {5, -40}};
  toy.ab.resize(2 * pixels);
  toy.question = {1, side, side, std::vector<float>(pixels)};
  for (std::size_t i = 0; i < pixels; ++i) {
    const float x = float(i % std::size_t(side)), y = float(i / std::size_t(side));
    const float wave = kind[i] == 1 ? std::sin(x * 1.6f) : kind[i] == 2 ? std::sin((x + y) * 0.45f) : 0.0f;
    const Lab<float> lab{55 + 8 * wave, kColors[kind[i]][0], kColors[kind[i]][1]};
    const Vec3<float> rgb = gamut_mapped_linear_rgb_from_lab(lab);
    for (int c = 0; c < 3; ++c) toy.linear_rgb.push_back(rgb[c]);
    toy.question.lightness[i] = lab.lightness;
    toy.ab[i] = lab.a;
    toy.ab[pixels + i] = lab.b;
  }
  return toy;
}

double mean_distance(const std::vector<float>& p, const std::vector<float>& q) {
  const std::size_t n = p.size() / 2;
  double sum = 0;
  for (std::size_t i = 0; i < n; ++i) sum += std::hypot(p[i] - q[i], p[n + i] - q[n + i]);
  return sum / double(n);
}

void save_png(const Toy& toy, const std::filesystem::path& file, bool grey = false) {
  cv::Mat image(toy.side, toy.side, CV_8UC3);
  for (std::size_t i = 0; i < toy.linear_rgb.size(); ++i) {
    const std::size_t channel = i % 3, from = grey ? i - channel + 1 : i;
    image.data[i - channel + 2 - channel] =
        static_cast<unsigned char>(std::lround(255 * std::clamp(srgb_from_linear(toy.linear_rgb[from]), 0.0f, 1.0f)));
  }
  ASSERT_TRUE(cv::imwrite(file.string(), image));
}

/// Small enough for a test: fractions of a second for the shortest fits.
ReferenceRecipe short_recipe(int steps) {
  ReferenceRecipe recipe;
  recipe.steps = steps;
  recipe.channels = {16, 24, 32, 32};
  recipe.patch_size = 64;
  recipe.distortion.share_min = 0.3;
  return recipe;
}

ReferenceImage photograph_of(const Toy& toy) {
  const test::TempDir folder;
  save_png(toy, folder / "toy.png");
  return load_reference_image(folder / "toy.png");
}

TEST(ReferenceNetwork, LearnsColourFromTextureAndCarriesItToAnotherView) {
  const Toy seen = toy_scene(1), unseen = toy_scene(2);
  const std::vector<ReferenceImage> images{photograph_of(seen)};
  const ReferenceRecipe recipe = short_recipe(250);
  ReferenceNetwork network(recipe, images, 1);
  const std::vector<float> grey(unseen.ab.size(), 0.0f);
  const double of_grey = mean_distance(grey, unseen.ab);
  EXPECT_GT(mean_distance(network.colorize(unseen.question).ab, unseen.ab), 0.6 * of_grey) << "before the fit";
  network.fit(images, {});
  EXPECT_LT(mean_distance(network.colorize(unseen.question).ab, unseen.ab), 0.35 * of_grey);
}

TEST(ReferenceNetwork, TheSameSeedGivesTheSameWeightsWithAnyNumberOfThreads) {
  const Toy toy = toy_scene(1);
  const std::vector<ReferenceImage> images{photograph_of(toy)};
  const ReferenceRecipe recipe = short_recipe(4);
  const auto fitted = [&](int threads, std::uint64_t seed) {
    set_thread_count(threads);
    ReferenceNetwork network(recipe, images, seed);
    network.fit(images, {});
    set_thread_count(0);
    return network.weights();
  };
  const std::vector<float> once = fitted(1, 5);
  EXPECT_EQ(once, fitted(2, 5));
  EXPECT_EQ(once, fitted(4, 5));
  EXPECT_NE(once, fitted(1, 6));
}

TEST(ReferenceNetwork, StartsAsItWouldWithoutTheBuiltinNetworkAndLearnsToUseIt) {
  const Toy toy = toy_scene(1);
  const std::vector<ReferenceImage> images{photograph_of(toy)};
  const ReferenceRecipe alone = short_recipe(4);
  ReferenceRecipe guided = alone;
  use_builtin(guided, builtin_weights_file());
  ReferenceNetwork plain(alone, images, 3), on_builtin(guided, images, 3);
  EXPECT_GT(on_builtin.weights().size(), plain.weights().size());
  const LightnessBatch question = test::some_question(2, 64, 96);
  EXPECT_EQ(on_builtin.colorize(question).ab, plain.colorize(question).ab);

  plain.fit(images, {});
  on_builtin.fit(images, {});
  EXPECT_NE(on_builtin.colorize(question).ab, plain.colorize(question).ab);
  EXPECT_NE(guided.text(), alone.text()) << "a cached fit would be taken for another";

  const auto fitted = [&](int threads) {
    set_thread_count(threads);
    ReferenceNetwork network(guided, images, 5);
    network.fit(images, {});
    set_thread_count(0);
    return network.weights();
  };
  EXPECT_EQ(fitted(1), fitted(4));
  guided.builtin = "no such.weights";
  EXPECT_THROW(ReferenceNetwork(guided, images, 1), MissingInputError);
}

TEST(ReferenceNetwork, AnswersAnySizeAndWeightsComeBack) {
  const Toy toy = toy_scene(1);
  const std::vector<ReferenceImage> images{photograph_of(toy)};
  ReferenceNetwork network(short_recipe(3), images, 1), other(short_recipe(3), images, 2);
  network.fit(images, {});
  for (const auto& question : {test::some_question(3, 64, 64), test::some_question(1, 37, 81)}) {
    const std::vector<float> answer = network.colorize(question).ab;
    EXPECT_EQ(answer.size(), 2 * question.lightness.size());
    other.set_weights(network.weights());
    EXPECT_EQ(other.colorize(question).ab, answer);
    // Of a mirrored picture it is mirrored, and each patch has its own.
    LightnessBatch mirrored = question;
    const auto width = std::size_t(question.width);
    for (auto row = mirrored.lightness.begin(); row != mirrored.lightness.end(); row += question.width) {
      std::reverse(row, row + question.width);
    }
    const std::vector<float> certainty = network.colorize(question).certainty;
    const std::vector<float> of_mirrored = network.colorize(mirrored).certainty;
    ASSERT_EQ(certainty.size(), question.lightness.size());
    EXPECT_THAT(certainty, testing::Each(testing::AllOf(testing::Gt(1.0f / kAbBinCount), testing::Le(1.0f))));
    if (width % 64 != 0) continue;  // what a side is filled up with is not mirrored
    for (std::size_t i = 0; i < certainty.size(); ++i) {
      ASSERT_NEAR(certainty[i], of_mirrored[i / width * width + width - 1 - i % width], 1e-4);
    }
  }
}

TEST(ReferenceImages, PatchesKeepColoursAndHoldThePlaceTheyShow) {
  // Left half red, right half blue, no distortion of tone: colours of a patch are those two.
  const test::TempDir folder;
  cv::Mat halves(300, 400, CV_8UC3, cv::Scalar(0, 0, 188));
  halves(cv::Rect(200, 0, 200, 300)).setTo(cv::Scalar(188, 0, 0));
  cv::imwrite((folder / "halves.png").string(), halves);
  const std::vector<ReferenceImage> images{load_reference_image(folder / "halves.png")};
  const PatchDistortion none{0.9, 1.0, 0, 0, false, 0, 0, 0, 0};
  std::vector<float> lightness(64 * 64), ab(2 * 64 * 64);
  SequentialRng rng(1, 1);
  sample_reference_patch(images, none, 64, rng, lightness, ab);
  EXPECT_GT(ab[64 * 64 + 32 * 64], 20) << "b of the left border: red";
  EXPECT_LT(ab[64 * 64 + 32 * 64 + 63], -50) << "b of the right border: blue";
  PatchDistortion mirrored = none;
  mirrored.flip = true;
  int flipped = 0;
  for (int i = 0; i < 40; ++i) {
    sample_reference_patch(images, mirrored, 64, rng, lightness, ab);
    flipped += ab[64 * 64 + 32 * 64] < 0 ? 1 : 0;
  }
  EXPECT_GT(flipped, 8);
  EXPECT_LT(flipped, 32);
}

/// A dull red square on a fiftieth of a picture, the rest of which is transparent.
TEST(ReferenceImages, WhatIsTransparentIsNotLearned) {
  const test::TempDir folder;
  const std::string file = (folder / "painted.png").string();
  for (const cv::Vec4b& hidden : {cv::Vec4b(0, 0, 0, 0), cv::Vec4b(0, 255, 0, 0)}) {  // B G R A: black, green
    cv::Mat4b picture(192, 192, hidden);
    picture(cv::Rect(80, 80, 27, 27)).setTo(cv::Scalar(90, 90, 160, 255));
    ASSERT_TRUE(cv::imwrite(file, picture));
    const std::vector<ReferenceImage> images{load_reference_image(file)};

    const PatchDistortion none{0.9, 1.0, 0, 0, false, 0, 0, 0, 0};
    std::vector<float> lightness(64 * 64), ab(2 * 64 * 64);
    SequentialRng rng(1, 1);
    sample_reference_patch(images, none, 64, rng, lightness, ab);
    int known = 0;
    for (std::size_t i = 0; i < lightness.size(); ++i) {
      if (std::isnan(ab[i])) continue;
      ++known;
      EXPECT_GT(ab[i], 10) << "red";
      EXPECT_GT(lightness[i], 20);
    }
    EXPECT_NEAR(known, 27 * 27 / 9.0, 40);
    EXPECT_NEAR(lightness[0], 0, 1e-3) << "over black";

    ReferenceNetwork network(short_recipe(3), images, 1);
    network.fit(images, {});
    const LightnessBatch question = test::some_question(1, 64, 64);
    const std::vector<float> answer = network.colorize(question).ab;
    for (std::size_t i = 0; i < question.lightness.size(); ++i) ASSERT_GT(answer[i], 10) << "red";
    for (const float weight : network.weights()) ASSERT_TRUE(std::isfinite(weight));
  }
  ASSERT_TRUE(cv::imwrite(file, cv::Mat4b(192, 192, cv::Vec4b(0, 255, 0, 0))));
  EXPECT_THAT(message_of<InputError>([&] { (void)load_reference_image(file); }), HasSubstr("transparent"));
}

TEST(ReferenceImages, OpenExrIsReadAsPngIs) {
  const Toy toy = toy_scene(1);
  const std::span<const float> rgb = toy.linear_rgb;
  const test::TempDir folder;
  write_exr(folder / "toy.exr",
            {toy.side, toy.side, {{"R", rgb, 3}, {"G", rgb.subspan(1), 3}, {"B", rgb.subspan(2), 3}}, {}});
  const ReferenceImage exr = load_reference_image(folder / "toy.exr"), png = photograph_of(toy);
  const std::vector<float>&found = exr.levels[0].lab, &expected = png.levels[0].lab;
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) ASSERT_NEAR(found[i], expected[i], 1.5);  // 8 bits of the other
}

TEST(ReferenceColorizer, LearnsFromEachPatchTwice) {
  const test::TempDir folder;
  save_png(toy_scene(1), folder / "toy.png");
  ColorizerOptions options;
  options.spec = "reference:" + (folder / "toy.png").string();
  options.reference_steps = 6;
  options.reference_encoder = "off";
  const auto asked = [&](Colorizer& colorizer) { return colorizer.colorize(test::some_question(1, 64, 64)).ab; };
  const std::vector<float> answer = asked(*make_colorizer(options));
  const auto fitted = [&](int uses) {
    ReferenceRecipe recipe;
    recipe.steps = options.reference_steps;
    recipe.builtin = builtin_weights_file();
    recipe.patch_uses = uses;
    recipe.patches_held = 16;
    const ColorizerContext context;
    return asked(*fit_reference_colorizer({(folder / "toy.png").string(), options, context}, recipe));
  };
  EXPECT_EQ(answer, fitted(2));
  EXPECT_NE(answer, fitted(1)) << "patches that are learned from once are others";
}

TEST(ReferenceColorizer, RefusesWhatIsNoColourPhotograph) {
  const test::TempDir folder;
  save_png(toy_scene(1), folder / "grey.png", true);
  EXPECT_THAT(message_of<InputError>([&] { test::colorizer_of("reference:" + (folder / "grey.png").string()); }),
              AllOf(HasSubstr("grey.png"), HasSubstr("colour")));
  write_file(folder / "text.png", "no image");
  EXPECT_THAT(message_of<InputError>([&] { test::colorizer_of("reference:" + (folder / "text.png").string()); }),
              HasSubstr("text.png"));
  write_file(folder / "empty.png", "");
  EXPECT_THROW(test::colorizer_of("reference:" + (folder / "empty.png").string()), InputError);
  EXPECT_THROW(test::colorizer_of("reference:,"), UsageError);
}

TEST(ReferenceColorizer, NamesTellFitsApart) {
  const test::TempDir folder;
  ColorizerOptions options;
  options.spec = "reference:a.png";
  const auto name_of = [&](int steps, std::uint64_t seed) {
    const ColorizerContext context{folder.path(), {}, seed, {}};
    return fit_reference_colorizer({"a.png", options, context}, short_recipe(steps))->name();
  };
  save_png(toy_scene(1), folder / "a.png");
  const std::string name = name_of(1, 1);
  EXPECT_THAT(name, MatchesRegex("reference:a\\.png \\([0-9a-f]{8}\\)"));
  EXPECT_EQ(name_of(1, 1), name);
  EXPECT_NE(name_of(2, 1), name);
  EXPECT_NE(name_of(1, 2), name);
  save_png(toy_scene(2), folder / "a.png");
  EXPECT_NE(name_of(1, 1), name) << "another photograph";
}

TEST(ReferenceColorizer, KeepsWhatItFittedAndFitsAgainWhenThatIsDamaged) {
  const test::TempDir folder;
  save_png(toy_scene(1), folder / "one.png");
  save_png(toy_scene(2), folder / "two.png");
  int reports = 0;
  struct Stop {};
  const auto make = [&](const std::string& images, bool stop) {
    ColorizerOptions options;
    options.spec = "reference:" + images;
    const ColorizerContext context{folder.path(), folder / "cache", 1, [&](const Progress&) {
                                     ++reports;
                                     if (stop) throw Stop{};
                                   }};
    return fit_reference_colorizer({images, options, context}, short_recipe(30));
  };
  EXPECT_THROW(make("one.png", true), Stop);
  EXPECT_EQ(reports, 1) << "it had begun to fit";
  EXPECT_FALSE(std::filesystem::exists(folder / "cache")) << "a stopped fit leaves nothing";

  const auto first = make("one.png,two.png", false);
  const int of_fit = reports;
  EXPECT_EQ(of_fit, 1 + 3) << "a report every ten steps";
  const auto second = make("one.png,two.png", false);
  EXPECT_EQ(reports, of_fit) << "fitted again";
  const LightnessBatch question = test::some_question(2, 48, 48);
  EXPECT_EQ(first->colorize(question).ab, second->colorize(question).ab);

  const auto cached = std::filesystem::directory_iterator(folder / "cache")->path();
  std::vector<std::byte> content = read_binary_file(cached);
  const std::vector<std::byte> first_weights = content;
  content[content.size() / 2] ^= std::byte{1};
  write_file(cached, content);
  EXPECT_THROW(make("one.png,two.png", true), Stop) << "damaged weights were taken";
  EXPECT_THROW(make("two.png,one.png", true), Stop) << "another order is another fit";

  // A folder is its files in the order of their names.
  std::filesystem::create_directory(folder / "photographs");
  for (const char* name : {"one.png", "two.png"}) {
    std::filesystem::rename(folder / name, folder / "photographs" / name);
  }
  write_file(cached, first_weights);
  reports = 0;
  make("photographs", false);
  EXPECT_EQ(reports, 0) << "the same photographs were fitted again";
  std::filesystem::create_directory(folder / "none");
  EXPECT_THROW(make("none", false), MissingInputError);
}

}  // namespace
}  // namespace cnerf
