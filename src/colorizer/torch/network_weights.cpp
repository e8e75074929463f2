#include "src/colorizer/torch/network_weights.h"

#include <cstring>
#include <span>
#include <string_view>
#include <vector>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/gzip.h"

namespace cnerf {
namespace fs = std::filesystem;
using torch::Tensor;

namespace {

constexpr std::string_view kMagic = "CNERFCW3";
constexpr std::size_t kChecksumBytes = 64;
constexpr std::uint32_t kMostShortSide = 1024;              // pixels
constexpr std::size_t kMostContent = std::size_t(1) << 26;  // a file that unpacks to more is none of ours

template <typename T>
void append(std::vector<std::byte>& out, const T& value) {
  const auto bytes = std::as_bytes(std::span(&value, 1));
  out.insert(out.end(), bytes.begin(), bytes.end());
}

void append(std::vector<std::byte>& out, const void* data, std::size_t size) {
  const auto* bytes = static_cast<const std::byte*>(data);
  out.insert(out.end(), bytes, bytes + size);
}

/// Reads values in order and refuses to run past the end.
class Reader {
 public:
  Reader(const fs::path& file, std::span<const std::byte> content) : file_(file), rest_(content) {}

  std::span<const std::byte> take(std::size_t size) {
    if (size > rest_.size()) throw InputError(file_.string() + ": colorizer weights: the file is cut short");
    const auto taken = rest_.first(size);
    rest_ = rest_.subspan(size);
    return taken;
  }
  template <typename T>
  T value() {
    T result;
    std::memcpy(&result, take(sizeof result).data(), sizeof result);
    return result;
  }
  std::string text(std::size_t size) {
    const auto bytes = take(size);
    return {reinterpret_cast<const char*>(bytes.data()), size};
  }
  [[nodiscard]] std::span<const std::byte> rest() const { return rest_; }

 private:
  const fs::path& file_;
  std::span<const std::byte> rest_;
};

std::vector<std::uint8_t> evens_then_odds(std::span<const std::byte> content) {
  std::vector<std::uint8_t> sorted;
  sorted.reserve(content.size());
  for (std::size_t first : {0, 1}) {
    for (std::size_t i = first; i < content.size(); i += 2) sorted.push_back(std::to_integer<std::uint8_t>(content[i]));
  }
  return sorted;
}

/// Undoes `evens_then_odds`.
std::vector<std::byte> interleaved(std::span<const std::uint8_t> sorted) {
  std::vector<std::byte> content(sorted.size());
  const std::size_t evens = (sorted.size() + 1) / 2;
  for (std::size_t i = 0; i < sorted.size(); ++i) content[i] = std::byte{sorted[i / 2 + (i % 2 == 0 ? 0 : evens)]};
  return content;
}

int read_short_side(const fs::path& file, Reader& reader) {
  const auto side = reader.value<std::uint32_t>();
  if (side < ColorizerNetImpl::kInputMultiple || side > kMostShortSide) {
    throw InputError(file, "short side",
                     "expected " + std::to_string(ColorizerNetImpl::kInputMultiple) + " to " +
                         std::to_string(kMostShortSide) + " pixels, found " + std::to_string(side));
  }
  return int(side);
}

void read_parameter(const fs::path& file, Reader& reader, torch::OrderedDict<std::string, Tensor>& parameters) {
  const std::string name = reader.text(reader.value<std::uint32_t>());
  std::vector<std::int64_t> shape(std::min<std::uint32_t>(reader.value<std::uint32_t>(), 8));
  for (auto& size : shape) size = reader.value<std::uint32_t>();
  Tensor* parameter = parameters.find(name);
  if (parameter == nullptr || parameter->sizes() != torch::IntArrayRef(shape)) {
    throw InputError(file, name, "expected the parameters of this program's colorizer network, found another one's");
  }
  Tensor half = torch::empty(shape, torch::kHalf);
  const auto bytes = reader.take(half.nbytes());
  std::memcpy(half.data_ptr(), bytes.data(), bytes.size());
  parameter->copy_(half);
}

}  // namespace

void save_colorizer_weights(const fs::path& file, const ColorizerNet& network, const AbDecoding& decoding) {
  std::vector<std::byte> payload;
  append(payload, decoding.temperature);
  append(payload, decoding.gain);
  append(payload, std::uint32_t(decoding.short_side));
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
  append(content, kMagic.data(), kMagic.size());
  append(content, sha256(payload).data(), kChecksumBytes);
  const std::vector<std::byte> packed = gzip(evens_then_odds(payload));
  append(content, packed.data(), packed.size());
  write_file(file, content);
}

ColorizerWeights load_colorizer_weights(const fs::path& file) {
  const std::vector<std::byte> whole = read_binary_file(file);
  Reader header(file, whole);
  if (header.text(kMagic.size()) != kMagic) {
    throw InputError(file, "header", "expected colorizer weights of version 3 (" + std::string(kMagic) + ")");
  }
  ColorizerWeights weights;
  weights.sha256 = header.text(kChecksumBytes);
  const auto unpacked = gunzip(header.rest(), kMostContent);
  if (!unpacked) throw InputError(file, "checksum", "the packed content is damaged or cut short");
  const std::vector<std::byte> content = interleaved(*unpacked);
  if (sha256(content) != weights.sha256) {
    throw InputError(file, "checksum", "expected SHA-256 " + weights.sha256 + ", found " + sha256(content));
  }
  Reader reader(file, content);
  weights.decoding.temperature = reader.value<double>();
  weights.decoding.gain = reader.value<double>();
  weights.decoding.short_side = read_short_side(file, reader);
  weights.network = ColorizerNet(Normalisation::kFolded);

  const torch::NoGradGuard no_grad;
  auto parameters = weights.network->named_parameters();
  const auto count = reader.value<std::uint32_t>();
  if (count != parameters.size()) {
    throw InputError(file, "parameters",
                     "expected " + std::to_string(parameters.size()) + ", found " + std::to_string(count));
  }
  for (std::uint32_t i = 0; i < count; ++i) read_parameter(file, reader, parameters);
  weights.network->eval();
  return weights;
}

}  // namespace cnerf
