#pragma once
/// Models in TensorFlow.js' layers format with random weights.

#include <torch/torch.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "src/base/files.h"

namespace cnerf::test {

/// A model to be written: weights in an order, then shards of an odd size.
struct MadeModel {
  using json = nlohmann::json;

  std::vector<std::pair<std::string, torch::Tensor>> weights;
  json layers = json::array();
  json changed = nullptr;  ///< applied to model.json: a JSON merge patch
  std::size_t shard = 1000;

  void conv(const std::string& name, const std::string& norm, std::vector<std::int64_t> shape) {
    const auto out = shape[3];
    const double gain = 1 / std::sqrt(double(shape[0] * shape[1] * shape[2]));
    weights.emplace_back(name + "/kernel", torch::randn(shape) * gain);
    weights.emplace_back(name + "/bias", torch::randn({out}) * 0.1);
    weights.emplace_back(norm + "/gamma", torch::rand({out}) + 0.5);
    weights.emplace_back(norm + "/beta", torch::randn({out}) * 0.1);
    weights.emplace_back(norm + "/moving_mean", torch::randn({out}) * 0.1);
    weights.emplace_back(norm + "/moving_variance", torch::rand({out}) + 0.5);
    layers.push_back({{"class_name", "BatchNormalization"}, {"config", {{"name", norm}, {"epsilon", 0.001}}}});
  }
  [[nodiscard]] torch::Tensor get(const std::string& name) const {
    return std::ranges::find(weights, name, &std::pair<std::string, torch::Tensor>::first)->second;
  }
  void write(const std::filesystem::path& folder) const {
    std::string bytes;
    json entries = json::array(), paths = json::array();
    for (const auto& [name, value] : weights) {
      entries.push_back({{"name", name}, {"shape", value.sizes().vec()}, {"dtype", "float32"}});
      bytes.append(static_cast<const char*>(value.contiguous().data_ptr()), value.nbytes());
    }
    for (std::size_t begin = 0; begin < bytes.size(); begin += shard) {
      paths.push_back("shard" + std::to_string(paths.size()) + ".bin");
      write_file(folder / paths.back().get<std::string>(), bytes.substr(begin, shard));
    }
    json model{{"format", "layers-model"},
               {"modelTopology", {{"model_config", {{"config", {{"layers", layers}}}}}}},
               {"weightsManifest", json::array({{{"paths", paths}, {"weights", entries}}})}};
    model.merge_patch(changed.is_null() ? json::object() : changed);
    write_file(folder / "model.json", model.dump());
  }
};

/// A ResNet-50 of two filters in its first layer instead of 64.
inline MadeModel small_resnet(std::uint64_t seed = 2) {
  torch::manual_seed(seed);
  MadeModel made;
  made.shard = 4001;
  made.conv("conv1", "bn_conv1", {7, 7, 3, 2});
  std::int64_t in = 2, width = 2;
  const std::vector<std::string> stages{"2abc", "3abcd", "4abcdef", "5abc"};
  for (const std::string& stage : stages) {
    for (const char letter : stage.substr(1)) {
      const std::string name = std::string{stage[0], letter} + "_branch";
      const auto add = [&](const std::string& branch, std::vector<std::int64_t> shape) {
        made.conv("res" + name + branch, "bn" + name + branch, std::move(shape));
      };
      add("2a", {1, 1, in, width});
      add("2b", {3, 3, width, width});
      add("2c", {1, 1, width, 4 * width});
      if (letter == 'a') add("1", {1, 1, in, 4 * width});
      in = 4 * width;
    }
    width *= 2;
  }
  return made;
}

}  // namespace cnerf::test
