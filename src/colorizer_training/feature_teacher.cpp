#include "src/colorizer_training/feature_teacher.h"

#include <cstring>
#include <sstream>
#include <vector>

#include "src/base/error.h"
#include "src/base/files.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace F = torch::nn::functional;
using torch::Tensor;

namespace {

constexpr std::int64_t kInputSide = 192;  // small pictures are enlarged: the classifier knows 224 pixels

std::vector<std::int64_t> parse_shape(const std::string& text) {
  std::vector<std::int64_t> shape;
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, 'x');) shape.push_back(std::stoll(part));
  return shape;
}

fs::path manifest_of(const fs::path& weights) {
  std::string stem = weights.stem().string();
  if (stem.ends_with("_f32")) stem.resize(stem.size() - 4);
  return weights.parent_path() / (stem + "_manifest.txt");
}

}  // namespace

FeatureTeacher::FeatureTeacher(const fs::path& weights, torch::Device device) : file_(weights) {
  const std::vector<std::byte> content = read_binary_file(weights);
  std::istringstream manifest(read_text_file(manifest_of(weights)));
  std::string name, shape_text;
  std::size_t offset = 0;
  while (manifest >> name >> shape_text >> offset) {
    Tensor tensor = torch::empty(parse_shape(shape_text));
    if (offset * sizeof(float) + tensor.nbytes() > content.size()) {
      throw InputError(weights, name, "lies beyond the end of the file");
    }
    std::memcpy(tensor.data_ptr(), content.data() + offset * sizeof(float), tensor.nbytes());
    weights_[name] = tensor.to(device);
  }
}

const Tensor& FeatureTeacher::at(const std::string& name) const {
  const auto found = weights_.find(name);
  if (found == weights_.end()) throw InputError(file_, name, "missing; expected LPIPS's SqueezeNet 1.1");
  return found->second;
}

Tensor FeatureTeacher::fire(const Tensor& x, const std::string& name) const {
  const std::string base = "core.net." + name + ".";
  const auto layer = [&](const Tensor& in, const std::string& part, std::int64_t padding) {
    return torch::relu(torch::conv2d(in, at(base + part + ".weight"), at(base + part + ".bias"), 1, padding));
  };
  const Tensor squeezed = layer(x, "squeeze", 0);
  return torch::cat({layer(squeezed, "expand1x1", 0), layer(squeezed, "expand3x3", 1)}, 1);
}

Tensor FeatureTeacher::features(const Tensor& srgb, std::int64_t rows, std::int64_t columns) const {
  const torch::NoGradGuard no_grad;
  const auto pool = [](const Tensor& in) { return torch::max_pool2d(in, 3, 2, 0, 1, /*ceil_mode=*/true); };
  Tensor x = F::interpolate(srgb, F::InterpolateFuncOptions()
                                      .size(std::vector<std::int64_t>{kInputSide, kInputSide})
                                      .mode(torch::kBilinear)
                                      .align_corners(false));
  x = (2 * x - 1 - at("core.scaling_layer.shift")) / at("core.scaling_layer.scale");
  x = torch::relu(torch::conv2d(x.contiguous(torch::MemoryFormat::ChannelsLast), at("core.net.slice1.0.weight"),
                                at("core.net.slice1.0.bias"), 2));
  x = fire(fire(pool(x), "slice2.3"), "slice2.4");
  x = fire(fire(pool(x), "slice3.6"), "slice3.7");
  x = fire(pool(x), "slice4.9");
  x = fire(x, "slice5.10");
  x = fire(x, "slice6.11");
  x = fire(x, "slice7.12");
  return torch::adaptive_avg_pool2d(x.to(torch::kFloat32), {rows, columns});
}

}  // namespace cnerf
