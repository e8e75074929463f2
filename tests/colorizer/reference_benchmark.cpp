// How far a reference network's colours are from the truth on other views of the same scene, against all-grey.
//
//   reference_benchmark FOLDER [held] [views=8] [seed=1] [steps=600] [rate=4e-3] …
//
// The files of FOLDER, sorted, are the views; every 8th is held out; the middle one of the others is the reference.
// Without `held` the other training views are measured: settings are chosen on those.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "src/colorizer/torch/encoder.h"
#include "src/colorizer/torch/reference_network.h"
#include "src/picture/contact_sheet.h"
#include "src/picture/encode.h"

namespace {

using namespace cnerf;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

struct Settings {
  std::string folder, picture;
  bool held = false;
  int views = 8, patches_per_view = 6;
  std::uint64_t seed = 1;
  ReferenceRecipe recipe;
};

std::vector<int> numbers(const std::string& text) {
  std::vector<int> result;
  std::stringstream stream(text);
  for (std::string item; std::getline(stream, item, ',');) result.push_back(std::stoi(item));
  return result;
}

Settings parse(int argc, char** argv) {
  Settings s;
  s.folder = argv[1];
  ReferenceRecipe& r = s.recipe;
  const std::map<std::string, std::function<void(const std::string&)>> setters = {
      {"views", [&](auto& v) { s.views = std::stoi(v); }},
      {"seed", [&](auto& v) { s.seed = std::stoull(v); }},
      {"picture", [&](auto& v) { s.picture = v; }},
      {"steps", [&](auto& v) { r.steps = std::stoi(v); }},
      {"batch", [&](auto& v) { r.batch = std::stoi(v); }},
      {"shards", [&](auto& v) { r.shards = std::stoi(v); }},
      {"size", [&](auto& v) { r.patch_size = std::stoi(v); }},
      {"rate", [&](auto& v) { r.learning_rate = std::stod(v); }},
      {"decay", [&](auto& v) { r.weight_decay = std::stod(v); }},
      {"builtin", [&](auto& v) { use_builtin(r, v); }},
      {"encoder", [&](auto& v) { use_encoder(r, load_encoder(v)); }},
      {"uses", [&](auto& v) { r.patch_uses = std::stoi(v); }},
      {"held_patches", [&](auto& v) { r.patches_held = std::stoi(v); }},
      {"channels", [&](auto& v) { r.channels = numbers(v); }},
      {"share_min", [&](auto& v) { r.distortion.share_min = std::stod(v); }},
      {"share_max", [&](auto& v) { r.distortion.share_max = std::stod(v); }},
      {"rotation", [&](auto& v) { r.distortion.rotation = std::stod(v); }},
      {"stretch", [&](auto& v) { r.distortion.stretch = std::stod(v); }},
      {"flip", [&](auto& v) { r.distortion.flip = std::stoi(v) != 0; }},
      {"gamma", [&](auto& v) { r.distortion.log_gamma = std::stod(v); }},
      {"contrast", [&](auto& v) { r.distortion.contrast = std::stod(v); }},
      {"blur", [&](auto& v) { r.distortion.blur = std::stod(v); }},
      {"noise", [&](auto& v) { r.distortion.noise = std::stod(v); }},
  };
  for (int i = 2; i < argc; ++i) {
    const std::string argument = argv[i];
    const std::size_t equals = argument.find('=');
    if (argument == "held") {
      s.held = true;
    } else {
      setters.at(argument.substr(0, equals))(argument.substr(equals + 1));
    }
  }
  return s;
}

struct Tally {
  double error = 0, grey = 0;
  std::size_t pixels = 0;
  void add(const std::vector<float>& answer, const std::vector<float>& truth) {
    const std::size_t n = truth.size() / 2;
    for (std::size_t i = 0; i < n; ++i) {
      error += std::hypot(answer[i] - truth[i], answer[n + i] - truth[n + i]);
      grey += std::hypot(truth[i], truth[n + i]);
    }
    pixels += n;
  }
  void print(const char* what) const {
    std::printf("%-12s ab distance %6.3f  grey %6.3f  ratio %.3f\n", what, error / double(pixels),
                grey / double(pixels), error / grey);
  }
};

Picture picture_of(const LightnessBatch& question, const std::vector<float>& ab) {
  return picture_from_linear(question.width, question.height, linear_rgb_from_lab(question.lightness, ab));
}

LightnessBatch whole_view(const LabImage& image, std::vector<float>& truth) {
  const std::size_t n = image.lab.size() / 3;
  LightnessBatch batch{1, image.height, image.width, std::vector<float>(n)};
  truth.resize(2 * n);
  for (std::size_t i = 0; i < n; ++i) {
    batch.lightness[i] = image.lab[3 * i];
    truth[i] = image.lab[3 * i + 1];
    truth[n + i] = image.lab[3 * i + 2];
  }
  return batch;
}

std::vector<std::string> views_to_measure(const std::vector<std::string>& files, const Settings& s,
                                          std::size_t reference) {
  std::vector<std::string> all;
  for (std::size_t i = 0; i < files.size(); ++i) {
    if ((i % 8 == 0) == s.held && i != reference) all.push_back(files[i]);
  }
  std::vector<std::string> some;
  const std::size_t count = std::min(all.size(), std::size_t(s.views));
  for (std::size_t i = 0; i < count; ++i) some.push_back(all[(2 * i + 1) * all.size() / (2 * count)]);
  return some;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: %s FOLDER [held] [key=value ...]\n", argv[0]);
    return 64;
  }
  const Settings s = parse(argc, argv);
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(s.folder)) files.push_back(entry.path().string());
  std::sort(files.begin(), files.end());
  std::size_t reference = files.size() / 2;
  if (reference % 8 == 0) ++reference;

  std::vector<ReferenceImage> images;
  images.push_back(load_reference_image(files[reference]));
  const auto start = Clock::now();
  ReferenceNetwork network(s.recipe, images, s.seed);
  double loss = 0;
  network.fit(images, [&](const Progress& p) { loss = p.figures[0].second; });
  std::printf("%s: fit %.1f s, %zu weights, loss %.4f\n", files[reference].c_str(), seconds_since(start),
              network.weights().size(), loss);

  Tally whole, patches;
  double patch_seconds = 0;
  std::vector<Tile> tiles;
  const int size = 128;
  const std::size_t pixels = size * size;
  PatchDistortion none{0.3, 0.7, 0, 0, false, 0, 0, 0, 0};
  SequentialRng rng(99, 1);
  std::vector<float> truth(2 * pixels);
  for (const std::string& file : views_to_measure(files, s, reference)) {
    const std::vector<ReferenceImage> view{load_reference_image(file)};
    std::vector<float> view_truth;
    const LightnessBatch question = whole_view(view[0].levels[0], view_truth);
    const std::vector<float> answer = network.colorize(question).ab;
    whole.add(answer, view_truth);
    tiles.push_back({picture_of(question, view_truth), "truth"});
    tiles.push_back({picture_of(question, answer), "answer"});
    for (int i = 0; i < s.patches_per_view; ++i) {
      LightnessBatch patch{1, size, size, std::vector<float>(pixels)};
      sample_reference_patch(view, none, size, rng, patch.lightness, truth);
      const auto asked = Clock::now();
      const std::vector<float> patch_answer = network.colorize(patch).ab;
      patch_seconds += seconds_since(asked);
      patches.add(patch_answer, truth);
    }
  }
  whole.print("whole views");
  patches.print("patches");
  std::printf("%.1f ms a patch, asked one by one\n", 1000 * patch_seconds / (double(patches.pixels) / double(pixels)));
  if (!s.picture.empty()) write_png(s.picture, tiled(tiles, 4));
  return 0;
}
