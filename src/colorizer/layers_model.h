#pragma once
/// A network that TensorFlow.js keeps as "layers model": `model.json` with the names, shapes and settings of its
/// layers, and shards, files of weights one after the other. Without the library that runs it.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace cnerf {

struct LayersModel {
  struct Weight {
    std::vector<std::int64_t> shape;
    std::span<const std::byte> floats;  ///< of `bytes`: float32 in C order, little-endian
  };
  std::filesystem::path file;             ///< model.json, which errors name
  std::map<std::string, Weight> weights;  ///< by name: "conv1/kernel"
  std::map<std::string, double> epsilon;  ///< of each batch normalisation, by the layer's name
  std::string sha256;                     ///< of model.json and its shards, in their order
  std::vector<std::byte> bytes;           ///< all shards

  LayersModel() = default;
  LayersModel(LayersModel&&) = default;  // spans stay valid when a vector moves, not when it is copied
  LayersModel& operator=(LayersModel&&) = default;

  /// @throws InputError  naming the weight, where it is missing or has another shape.
  [[nodiscard]] const Weight& weight(const std::string& name, const std::vector<std::int64_t>& shape) const;
  /// @throws InputError  naming the layer, where there is no such batch normalisation.
  [[nodiscard]] double epsilon_of(const std::string& layer) const;
};

/// @throws MissingInputError  no model.json in `folder`, or no file of a shard that it names.
/// @throws InputError         another format, weights that are not float32 or not finite, shards of another size than
///                            the weights; naming file, field and value.
[[nodiscard]] LayersModel read_layers_model(const std::filesystem::path& folder);

/// Where the optional encoder, ResNet-50, is looked for: $CNERF_ENCODER, else the user's data folder.
[[nodiscard]] std::filesystem::path encoder_folder();
[[nodiscard]] bool is_encoder_installed();

/// "[3, 3, 64, 64]"
[[nodiscard]] std::string shape_text(const std::vector<std::int64_t>& shape);

}  // namespace cnerf
