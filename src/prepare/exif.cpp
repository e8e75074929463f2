#include "src/prepare/exif.h"

#include <libexif/exif-data.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <vector>

namespace cnerf::prepare {
namespace {

using Bytes = std::span<const std::byte>;

std::uint32_t big_endian(Bytes bytes, std::size_t at, std::size_t count) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < count; ++i) value = value << 8 | std::to_integer<std::uint32_t>(bytes[at + i]);
  return value;
}

bool starts_with(Bytes bytes, const char* text, std::size_t size) {
  return bytes.size() >= size && std::memcmp(bytes.data(), text, size) == 0;
}

/// The TIFF structure inside an APP1 segment.
std::optional<Bytes> block_of_jpeg(Bytes file) {
  std::size_t at = 2;
  while (at + 4 <= file.size() && file[at] == std::byte(0xFF)) {
    const std::uint32_t marker = big_endian(file, at + 1, 1);
    if (marker == 0xFF) {  // a fill byte
      ++at;
      continue;
    }
    if (marker == 0xDA || marker == 0xD9) break;
    const std::size_t size = big_endian(file, at + 2, 2);
    if (size < 2 || at + 2 + size > file.size()) break;
    const Bytes content = file.subspan(at + 4, size - 2);
    if (marker == 0xE1 && starts_with(content, "Exif\0\0", 6)) return content.subspan(6);
    at += 2 + size;
  }
  return std::nullopt;
}

std::optional<Bytes> block_of_png(Bytes file) {
  for (std::size_t at = 8; at + 12 <= file.size();) {
    const std::size_t size = big_endian(file, at, 4);
    if (size > file.size() - at - 12) break;
    if (std::memcmp(file.data() + at + 4, "eXIf", 4) == 0) return file.subspan(at + 8, size);
    at += 12 + size;
  }
  return std::nullopt;
}

std::optional<Bytes> exif_block(Bytes file) {
  if (starts_with(file, "\xFF\xD8", 2)) return block_of_jpeg(file);
  if (starts_with(file, "\x89PNG\r\n\x1A\n", 8)) return block_of_png(file);
  if (starts_with(file, "II*\0", 4) || starts_with(file, "MM\0*", 4)) return file;
  return std::nullopt;
}

struct FreeExif {
  void operator()(ExifData* data) const { exif_data_unref(data); }
};

double rational(const ExifEntry& entry, ExifByteOrder order) {
  if (entry.format == EXIF_FORMAT_SHORT && entry.size >= 2) return exif_get_short(entry.data, order);
  if (entry.format != EXIF_FORMAT_RATIONAL || entry.size < 8) return 0;
  const ExifRational value = exif_get_rational(entry.data, order);
  return value.denominator == 0 ? 0 : double(value.numerator) / value.denominator;
}

std::string text(ExifData* data, ExifTag tag) {
  ExifEntry* entry = exif_content_get_entry(data->ifd[EXIF_IFD_0], tag);
  if (entry == nullptr) return "";
  char value[256] = {};
  exif_entry_get_value(entry, value, sizeof value);
  return value;
}

}  // namespace

ExifFacts read_exif(Bytes file) {
  const std::optional<Bytes> block = exif_block(file);
  if (!block) return {};
  std::vector<unsigned char> tagged = {'E', 'x', 'i', 'f', 0, 0};  // libexif looks for this mark
  const auto* begin = reinterpret_cast<const unsigned char*>(block->data());
  tagged.insert(tagged.end(), begin, begin + block->size());
  const std::unique_ptr<ExifData, FreeExif> data(exif_data_new_from_data(tagged.data(), unsigned(tagged.size())));
  if (!data) return {};
  const ExifByteOrder order = exif_data_get_byte_order(data.get());
  ExifFacts facts;
  if (const ExifEntry* entry = exif_data_get_entry(data.get(), EXIF_TAG_ORIENTATION)) {
    const double value = rational(*entry, order);
    if (value >= 1 && value <= 8) facts.orientation = int(value);
  }
  if (const ExifEntry* entry = exif_data_get_entry(data.get(), EXIF_TAG_FOCAL_LENGTH)) {
    facts.focal_mm = rational(*entry, order);
  }
  if (const ExifEntry* entry = exif_data_get_entry(data.get(), EXIF_TAG_FOCAL_LENGTH_IN_35MM_FILM)) {
    facts.focal_35mm = rational(*entry, order);
  }
  facts.camera = text(data.get(), EXIF_TAG_MAKE);
  const std::string model = text(data.get(), EXIF_TAG_MODEL);
  if (!model.empty()) facts.camera += (facts.camera.empty() ? "" : " ") + model;
  return facts;
}

double focal_pixels(const ExifFacts& exif, int longer_side) {
  return exif.focal_35mm > 0 ? exif.focal_35mm / 36.0 * longer_side : 0;
}

}  // namespace cnerf::prepare
