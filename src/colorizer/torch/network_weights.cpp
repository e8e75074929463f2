#include "src/colorizer/torch/network_weights.h"

#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/gzip.h"
#include "src/colorizer/layers_model.h"
#include "src/colorizer/torch/encoder.h"
#include "src/colorizer/weights_content.h"

namespace cnerf {
namespace fs = std::filesystem;
using torch::Tensor;

namespace {

constexpr std::uint32_t kMostShortSide = 1024;  // pixels

template <typename T>
void append(std::vector<std::byte>& out, const T& value) {
  const auto bytes = std::as_bytes(std::span(&value, 1));
  out.insert(out.end(), bytes.begin(), bytes.end());
}

void append(std::vector<std::byte>& out, const void* data, std::size_t size) {
  const auto* bytes = static_cast<const std::byte*>(data);
  out.insert(out.end(), bytes, bytes + size);
}

std::vector<std::uint8_t> evens_then_odds(std::span<const std::byte> content) {
  std::vector<std::uint8_t> sorted;
  sorted.reserve(content.size());
  for (std::size_t first : {0, 1}) {
    for (std::size_t i = first; i < content.size(); i += 2) sorted.push_back(std::to_integer<std::uint8_t>(content[i]));
  }
  return sorted;
}

int checked_short_side(const fs::path& file, std::uint32_t side) {
  if (side < ColorizerNetImpl::kInputMultiple || side > kMostShortSide) {
    throw InputError(file, "short side",
                     "expected " + std::to_string(ColorizerNetImpl::kInputMultiple) + " to " +
                         std::to_string(kMostShortSide) + " pixels, found " + std::to_string(side));
  }
  return int(side);
}

/// The installed encoder, which has to be the one that the weights were trained beside; null where they need none.
std::shared_ptr<const Encoder> encoder_of(const fs::path& file, const WeightsContent& content) {
  if (content.encoder.empty()) return nullptr;
  std::shared_ptr<const Encoder> encoder = installed_encoder(file.string());
  if (encoder->sha256() != content.encoder) {
    throw InputError(file, "encoder",
                     "expected the one that the weights were trained beside, SHA-256 " + content.encoder + ", found " +
                         encoder->sha256() + " in " + encoder_folder().string());
  }
  return encoder;
}

void copy_parameter(const fs::path& file, const WeightsContent::Parameter& stored,
                    torch::OrderedDict<std::string, Tensor>& parameters) {
  Tensor* parameter = parameters.find(stored.name);
  if (parameter == nullptr || parameter->sizes() != torch::IntArrayRef(stored.shape)) {
    throw InputError(file, stored.name,
                     "expected the parameters of this program's colorizer network, found another one's");
  }
  Tensor half = torch::empty(stored.shape, torch::kHalf);
  std::memcpy(half.data_ptr(), stored.halves.data(), stored.halves.size());
  parameter->copy_(half);
}

}  // namespace

void save_colorizer_weights(const fs::path& file, const ColorizerNet& network, const AbDecoding& decoding) {
  std::vector<std::byte> payload;
  append(payload, decoding.temperature);
  append(payload, decoding.gain);
  append(payload, std::uint32_t(decoding.short_side));
  const std::string encoder = network->encoder() ? network->encoder()->sha256() : "";
  append(payload, std::uint32_t(encoder.size()));
  append(payload, encoder.data(), encoder.size());
  const auto parameters = network->named_parameters();
  append(payload, std::uint32_t(parameters.size()));
  for (const auto& item : parameters) {
    append(payload, std::uint32_t(item.key().size()));
    append(payload, item.key().data(), item.key().size());
    const Tensor half = item.value().detach().to(torch::kCPU, torch::kHalf).contiguous();
    append(payload, std::uint32_t(half.dim()));
    for (const std::int64_t size : half.sizes()) append(payload, std::uint32_t(size));
    append(payload, half.data_ptr(), half.nbytes());
  }
  std::vector<std::byte> content;
  append(content, kWeightsMagic.data(), kWeightsMagic.size());
  append(content, sha256(payload).data(), kWeightsChecksumBytes);
  const std::vector<std::byte> packed = gzip(evens_then_odds(payload));
  append(content, packed.data(), packed.size());
  write_file(file, content);
}

ColorizerWeights load_colorizer_weights(const fs::path& file) {
  const WeightsContent content = read_weights_content(file);
  ColorizerWeights weights;
  weights.sha256 = content.sha256;
  weights.decoding.temperature = content.temperature;
  weights.decoding.gain = content.gain;
  weights.decoding.short_side = checked_short_side(file, content.short_side);
  weights.network = ColorizerNet(Normalisation::kFolded, encoder_of(file, content));

  const torch::NoGradGuard no_grad;
  auto parameters = weights.network->named_parameters();
  if (content.parameters.size() != parameters.size()) {
    throw InputError(
        file, "parameters",
        "expected " + std::to_string(parameters.size()) + ", found " + std::to_string(content.parameters.size()));
  }
  for (const WeightsContent::Parameter& stored : content.parameters) copy_parameter(file, stored, parameters);
  weights.network->eval();
  return weights;
}

}  // namespace cnerf
