#include "src/colorizer/layers_model.h"

#include <cmath>
#include <cstdlib>
#include <cstring>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/json.h"

namespace cnerf {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::size_t kMostBytes = std::size_t(1) << 30;  // ten times ResNet-50
constexpr std::size_t kMostDimensions = 4;                // of a convolution's kernel

/// A member that has to be there.
const Json& member(const Json& object, const char* name, const LayersModel& model) {
  if (!object.is_object() || !object.contains(name)) {
    throw InputError(model.file, name, "expected it in " + excerpt(object) + ", found nothing");
  }
  return object.at(name);
}

const Json& list(const Json& object, const char* name, const LayersModel& model) {
  const Json& value = member(object, name, model);
  if (!value.is_array()) throw InputError(model.file, name, "expected a list, found " + excerpt(value));
  return value;
}

std::string text(const Json& object, const char* name, const LayersModel& model) {
  const Json& value = member(object, name, model);
  if (!value.is_string()) throw InputError(model.file, name, "expected a text, found " + excerpt(value));
  return value.get<std::string>();
}

/// Bytes of a weight of `shape`, which no file has where it is more than kMostBytes.
std::size_t size_of(const std::vector<std::int64_t>& shape) {
  std::size_t bytes = sizeof(float);
  for (const std::int64_t side : shape) {
    if (std::size_t(side) > kMostBytes / bytes) return kMostBytes + 1;
    bytes *= std::size_t(side);
  }
  return bytes;
}

std::vector<std::int64_t> shape_of(const Json& entry, const std::string& name, const LayersModel& model) {
  const Json& sides = list(entry, "shape", model);
  std::vector<std::int64_t> shape;
  for (const Json& side : sides) {
    if (!side.is_number_unsigned() || side.get<std::uint64_t>() == 0 || side.get<std::uint64_t>() > kMostBytes) {
      throw InputError(model.file, name, "expected a shape of sizes, found " + excerpt(sides));
    }
    shape.push_back(side.get<std::int64_t>());
  }
  if (shape.empty() || shape.size() > kMostDimensions) {
    throw InputError(model.file, name, "expected a shape of 1 to 4 sizes, found " + excerpt(sides));
  }
  return shape;
}

/// Appends the shards of a group to the model's bytes, and all read bytes to what is hashed.
void read_shards(const Json& group, LayersModel& model, std::string& hashes) {
  for (const Json& path : list(group, "paths", model)) {
    const std::string name = path.is_string() ? path.get<std::string>() : "";
    if (name.empty() || fs::path(name).filename() != name || name == "." || name == "..") {
      throw InputError(model.file, "paths", "expected the name of a file beside it, found " + excerpt(path));
    }
    const fs::path shard = model.file.parent_path() / name;
    std::error_code failure;  // a name too long for the file system is of no file
    if (!fs::is_regular_file(shard, failure))
      throw MissingInputError(shard.string() + ": missing; " + model.file.string() + " names it");
    if (fs::file_size(shard) > kMostBytes - model.bytes.size()) {
      throw InputError(shard, "", "expected at most 1 GiB in all shards");
    }
    const std::vector<std::byte> content = read_binary_file(shard);
    hashes += sha256(content);
    model.bytes.insert(model.bytes.end(), content.begin(), content.end());
  }
}

struct Place {
  std::string name;
  std::vector<std::int64_t> shape;
  std::size_t begin, size;
};

/// Where the weights of a group lie, whose shards begin at `begin` and end with the model's bytes.
std::vector<Place> places_of(const Json& group, const LayersModel& model, std::size_t begin) {
  const std::size_t shards = model.bytes.size() - begin;
  std::vector<Place> places;
  std::size_t wanted = 0;
  for (const Json& entry : list(group, "weights", model)) {
    const std::string name = text(entry, "name", model), type = text(entry, "dtype", model);
    if (type != "float32" || entry.contains("quantization")) {
      throw InputError(model.file, name, "expected float32, found " + excerpt(entry));
    }
    const std::vector<std::int64_t> shape = shape_of(entry, name, model);
    const std::size_t size = size_of(shape);
    if (wanted + size > shards) {
      throw InputError(model.file, name,
                       "expected " + std::to_string(wanted + size) + " bytes of shards up to its end, found " +
                           std::to_string(shards));
    }
    places.push_back({name, shape, begin + wanted, size});
    wanted += size;
  }
  if (wanted != shards) {
    throw InputError(model.file, "weightsManifest",
                     "expected shards of " + std::to_string(wanted) + " bytes, found " + std::to_string(shards));
  }
  return places;
}

void check_finite(const LayersModel& model, const Place& place) {
  for (std::size_t at = place.begin; at < place.begin + place.size; at += sizeof(float)) {
    float value = 0;
    std::memcpy(&value, model.bytes.data() + at, sizeof value);
    if (std::isfinite(value)) continue;
    throw InputError(model.file, place.name,
                     "expected finite numbers, found " + std::to_string(value) + " at " +
                         std::to_string((at - place.begin) / sizeof(float)));
  }
}

void read_epsilons(const Json& json, LayersModel& model) {
  const Json& settings = member(member(json, "modelTopology", model), "model_config", model);
  for (const Json& layer : list(member(settings, "config", model), "layers", model)) {
    if (text(layer, "class_name", model) != "BatchNormalization") continue;
    const Json& config = member(layer, "config", model);
    const std::string name = text(config, "name", model);
    const Json& epsilon = member(config, "epsilon", model);
    if (!epsilon.is_number() || epsilon.get<double>() <= 0) {
      throw InputError(model.file, name + ".epsilon", "expected a number above 0, found " + excerpt(epsilon));
    }
    model.epsilon[name] = epsilon.get<double>();
  }
}

}  // namespace

std::string shape_text(const std::vector<std::int64_t>& shape) {
  std::string result;
  for (const std::int64_t side : shape) result += (result.empty() ? "[" : ", ") + std::to_string(side);
  return result + "]";
}

const LayersModel::Weight& LayersModel::weight(const std::string& name, const std::vector<std::int64_t>& shape) const {
  const auto found = weights.find(name);
  if (found == weights.end()) throw InputError(file, name, "expected a weight of this name, found none");
  if (found->second.shape != shape) {
    throw InputError(file, name, "expected shape " + shape_text(shape) + ", found " + shape_text(found->second.shape));
  }
  return found->second;
}

double LayersModel::epsilon_of(const std::string& layer) const {
  const auto found = epsilon.find(layer);
  if (found == epsilon.end()) throw InputError(file, layer, "expected a batch normalisation of this name, found none");
  return found->second;
}

LayersModel read_layers_model(const fs::path& folder) {
  LayersModel model;
  model.file = folder / "model.json";
  if (!fs::exists(model.file)) throw MissingInputError(model.file.string() + ": missing");
  const Json json = read_json(model.file);
  if (text(json, "format", model) != "layers-model") {
    throw InputError(model.file, "format", "expected \"layers-model\", found " + excerpt(json.at("format")));
  }
  read_epsilons(json, model);
  std::string hashes = sha256_of_file(model.file);
  std::vector<Place> places;
  for (const Json& group : list(json, "weightsManifest", model)) {
    const std::size_t begin = model.bytes.size();
    read_shards(group, model, hashes);
    for (Place& place : places_of(group, model, begin)) places.push_back(std::move(place));
  }
  for (const Place& place : places) {
    check_finite(model, place);
    const LayersModel::Weight weight{place.shape, std::span(model.bytes).subspan(place.begin, place.size)};
    if (!model.weights.emplace(place.name, weight).second) {
      throw InputError(model.file, place.name, "expected each weight once, found it again");
    }
  }
  model.sha256 = sha256(std::as_bytes(std::span(hashes)));
  return model;
}

fs::path encoder_folder() {
  if (const char* named = std::getenv("CNERF_ENCODER")) return named;
  if (const char* data = std::getenv("XDG_DATA_HOME"); data != nullptr && *data != '\0') {
    return fs::path(data) / "cnerf" / "encoder";
  }
  const char* home = std::getenv("HOME");
  return home == nullptr ? fs::path() : fs::path(home) / ".local" / "share" / "cnerf" / "encoder";
}

bool is_encoder_installed() {
  const fs::path folder = encoder_folder();
  return !folder.empty() && fs::exists(folder / "model.json");
}

}  // namespace cnerf
