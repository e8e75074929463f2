/// cnerf colorize-image: what a colorizer makes of one picture, to judge it before a field is trained.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "src/app/command.h"
#include "src/app/run_arguments.h"
#include "src/base/files.h"
#include "src/capture/image_io.h"
#include "src/picture/encode.h"
#include "src/pipeline/colorize_step.h"
#include "src/prepare/photographs.h"

namespace cnerf::app {
namespace fs = std::filesystem;
namespace {

struct ColorizeImageArguments {
  ConfigArguments config;
  std::string in, out;
  int short_side = 256;
  bool overwrite = false;
};

std::vector<float> lightness_of(const LinearImage& luminance) {
  std::vector<float> lightness;
  for (const float y : luminance.values) lightness.push_back(std::clamp(lightness_from_luminance(y), 0.0f, 100.0f));
  return lightness;
}

/// L* of a picture, its short side at most `short_side` pixels.
LightnessBatch question_about(const LinearImage& luminance, int short_side) {
  const double factor = std::min(1.0, double(short_side) / std::min(luminance.width, luminance.height));
  const int width = std::max(2, int(std::lround(luminance.width * factor)));
  const int height = std::max(2, int(std::lround(luminance.height * factor)));
  return {1, height, width, lightness_of(area_resized(luminance, width, height))};
}

/// The picture's own lightness with the answer's chroma, brought to its size.
Picture colored(const LinearImage& luminance, const ChromaBatch& answer) {
  std::vector<float> ab = ab_of(answer, 0);
  const std::size_t small = ab.size() / 2;
  std::vector<float> whole(2 * luminance.pixel_count());
  for (std::size_t c = 0; c < 2; ++c) {
    const cv::Mat plane(answer.height, answer.width, CV_32F, ab.data() + c * small);
    cv::Mat resized(luminance.height, luminance.width, CV_32F, whole.data() + c * luminance.pixel_count());
    cv::resize(plane, resized, resized.size(), 0, 0, cv::INTER_LINEAR);
  }
  return picture_from_linear(luminance.width, luminance.height, linear_rgb_from_lab(lightness_of(luminance), whole));
}

void colorize_image(const ColorizeImageArguments& arguments) {
  Reporter reporter = make_reporter(arguments.config);
  refuse_existing(arguments.out, arguments.overwrite);
  LinearImage stored = luminance_image(read_linear_image(arguments.in, Transfer::kSrgb));
  const int orientation = prepare::orientation_of(read_binary_file(arguments.in));
  const LinearImage luminance = prepare::turned_upright(std::move(stored), orientation);
  Config config = resolve_config(arguments.config);
  if (config.colorizer.spec.empty()) config.colorizer.spec = "builtin";
  const auto colorizer = make_colorizer(config.colorizer, pipeline::colorizer_context(config, {}, {}, reporter));
  const LightnessBatch question = question_about(luminance, arguments.short_side);
  const ChromaBatch answer = colorizer->colorize(question);
  check_answer(colorizer->name(), question, answer);
  write_png(arguments.out, colored(luminance, answer));
  reporter.say(fmt::format("coloured by {} at {} x {}", colorizer->name(), question.width, question.height));
  reporter.wrote("picture", arguments.out);
}

}  // namespace

Work declare_colorize_image(CLI::App& app) {
  auto arguments = std::make_shared<ColorizeImageArguments>();
  app.add_option("IN", arguments->in, "A picture; its colours, if any, are not looked at")->required();
  app.add_option("OUT", arguments->out, "PNG to write")->required();
  add_config_options(app, arguments->config);
  add_short_form(app, arguments->config, "--colorizer", "colorizer.spec");
  app.add_option("--short-side", arguments->short_side, "The colorizer is shown the picture at this size, pixels")
      ->check(CLI::Range(32, 2048))
      ->capture_default_str();
  app.add_flag("--overwrite", arguments->overwrite, "Replace a picture that is there");
  return [arguments](const auto&) { colorize_image(*arguments); };
}

}  // namespace cnerf::app
