#include "src/colorizer/weights_content.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/gzip.h"
#include "src/base/plugin.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

constexpr std::size_t kMostContent = std::size_t(1) << 26;  // a file that unpacks to more is none of ours
constexpr std::uint32_t kMostTensorDimensions = 8;

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

/// The content's bytes in their order, from those at even places and then those at odd ones.
std::vector<std::byte> interleaved(std::span<const std::uint8_t> sorted) {
  std::vector<std::byte> content(sorted.size());
  const std::size_t evens = (sorted.size() + 1) / 2;
  for (std::size_t i = 0; i < sorted.size(); ++i) content[i] = std::byte{sorted[i / 2 + (i % 2 == 0 ? 0 : evens)]};
  return content;
}

/// Of numbers in half precision.
bool are_finite(std::span<const std::byte> halves) {
  constexpr std::byte kExponent{0x7C};  // in the second byte of each
  for (std::size_t i = 1; i < halves.size(); i += 2) {
    if ((halves[i] & kExponent) == kExponent) return false;
  }
  return true;
}

/// Its checksum, or nothing.
std::string encoder_in(const fs::path& file, Reader& reader) {
  const auto length = reader.value<std::uint32_t>();
  if (length != 0 && length != kWeightsChecksumBytes) {
    throw InputError(file, "encoder", "expected a SHA-256 of 64 characters or none, found " + std::to_string(length));
  }
  return reader.text(length);
}

WeightsContent::Parameter next_parameter(Reader& reader) {
  constexpr std::size_t kHalf = 2;  // bytes
  WeightsContent::Parameter parameter;
  parameter.name = reader.text(reader.value<std::uint32_t>());
  parameter.shape.resize(std::min(reader.value<std::uint32_t>(), kMostTensorDimensions));
  std::size_t bytes = kHalf;
  for (auto& size : parameter.shape) {
    size = reader.value<std::uint32_t>();
    bytes = std::min(bytes * std::size_t(size), kMostContent + 1);  // more is not there, and no product overflows
  }
  parameter.halves = reader.take(bytes);
  return parameter;
}

}  // namespace

std::vector<fs::path> builtin_weights_places() {
  std::vector<fs::path> places = data_places("colorizer.weights");
  if (const char* named = std::getenv("CNERF_COLORIZER_WEIGHTS")) places.insert(places.begin(), named);
  return places;
}

WeightsContent read_weights_content(const fs::path& file) {
  const std::vector<std::byte> whole = read_binary_file(file);
  Reader header(file, whole);
  const std::string magic = header.text(kWeightsMagic.size());
  if (magic != kWeightsMagic && magic != kWeightsMagicWithoutEncoder) {
    throw InputError(file, "header", "expected colorizer weights, CNERFCW3 or CNERFCW4");
  }
  WeightsContent content;
  content.sha256 = header.text(kWeightsChecksumBytes);
  const auto unpacked = gunzip(header.rest(), kMostContent);
  if (!unpacked) throw InputError(file, "checksum", "the packed content is damaged or cut short");
  content.bytes = interleaved(*unpacked);
  if (sha256(content.bytes) != content.sha256) {
    throw InputError(file, "checksum", "expected SHA-256 " + content.sha256 + ", found " + sha256(content.bytes));
  }
  Reader reader(file, content.bytes);
  content.temperature = reader.value<double>();
  content.gain = reader.value<double>();
  for (const double value : {content.temperature, content.gain}) {
    if (!(value > 0 && value < 1000)) {
      throw InputError(file, "temperature, gain", "expected numbers above 0, found " + std::to_string(value));
    }
  }
  content.short_side = reader.value<std::uint32_t>();
  if (magic == kWeightsMagic) content.encoder = encoder_in(file, reader);
  const auto count = reader.value<std::uint32_t>();
  for (std::uint32_t i = 0; i < count; ++i) {
    content.parameters.push_back(next_parameter(reader));
    if (are_finite(content.parameters.back().halves)) continue;
    throw InputError(file, content.parameters.back().name, "expected finite numbers, found others");
  }
  return content;
}

}  // namespace cnerf
