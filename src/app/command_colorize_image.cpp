/// cnerf colorize-image: what a colorizer makes of one picture, to judge it before a field is trained.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "src/app/command.h"
#include "src/app/default_colorizer.h"
#include "src/app/pipeline.h"
#include "src/app/run_arguments.h"
#include "src/capture/image_io.h"
#include "src/color/colorspace_math.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

struct ColorizeImageArguments {
  ConfigArguments config;
  std::string in, out;
  int short_side = 256;
  bool overwrite = false;
};

/// L* of a picture, its short side at most `short_side` pixels.
LightnessBatch question_about(const LinearImage& luminance, int short_side) {
  const double factor = std::min(1.0, double(short_side) / std::min(luminance.width, luminance.height));
  const int width = std::max(2, int(std::lround(luminance.width * factor)));
  const int height = std::max(2, int(std::lround(luminance.height * factor)));
  LightnessBatch question{1, height, width, area_resized(luminance, width, height).values};
  for (float& value : question.lightness) value = std::clamp(lightness_from_luminance(value), 0.0f, 100.0f);
  return question;
}

/// The picture's own lightness with the answer's chroma, brought to its size.
Picture colored(const LinearImage& luminance, const ChromaBatch& answer) {
  std::vector<float> ab = ab_of(answer, 0);
  const std::size_t small = ab.size() / 2;
  cv::Mat planes[2];
  for (std::size_t c = 0; c < 2; ++c) {
    const cv::Mat plane(answer.height, answer.width, CV_32F, ab.data() + c * small);
    cv::resize(plane, planes[c], {luminance.width, luminance.height}, 0, 0, cv::INTER_LINEAR);
  }
  std::vector<float> linear;
  for (std::size_t p = 0; p < luminance.pixel_count(); ++p) {
    const float lightness = std::clamp(lightness_from_luminance(luminance.values[p]), 0.0f, 100.0f);
    const Vec3<float> rgb =
        gamut_mapped_linear_rgb_from_lab(Lab<float>{lightness, planes[0].ptr<float>()[p], planes[1].ptr<float>()[p]});
    for (int c = 0; c < 3; ++c) linear.push_back(rgb[c]);
  }
  return picture_from_linear(luminance.width, luminance.height, linear);
}

void colorize_image(const ColorizeImageArguments& arguments) {
  Reporter reporter = make_reporter(arguments.config);
  refuse_existing(arguments.out, arguments.overwrite);
  const LinearImage luminance = luminance_image(read_linear_image(arguments.in, Transfer::kSrgb));
  Config config = resolve_config(arguments.config);
  if (config.colorizer.spec.empty()) config.colorizer.spec = "builtin";
  const auto colorizer = make_colorizer(colorizer_options(config, {}, {}, reporter));
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
  add_short_form(app, arguments->config, "--colorizer", "colorizer.spec", "Who colours; builtin if not given");
  app.add_option("--short-side", arguments->short_side, "The colorizer is shown the picture at this size, pixels")
      ->check(CLI::Range(32, 2048))
      ->capture_default_str();
  app.add_flag("--overwrite", arguments->overwrite, "Replace a picture that is there");
  return [arguments](const auto&) { colorize_image(*arguments); };
}

}  // namespace cnerf
