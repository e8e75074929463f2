#include "src/capture/mono_image.h"

#include <array>
#include <cmath>

#include "src/base/error.h"
#include "src/color/colorspace_math.h"

namespace cnerf {
namespace {

/// Linear light of the 256 codes of an 8-bit image.
std::array<float, 256> table_of(Transfer transfer) {
  std::array<float, 256> table{};
  for (std::size_t i = 0; i < table.size(); ++i) table[i] = decode_transfer(transfer, float(i) / 255.0f);
  return table;
}

const std::array<float, 256>& decode_table(Transfer transfer) {
  static const std::array<float, 256> srgb = table_of(Transfer::kSrgb);
  static const std::array<float, 256> linear = table_of(Transfer::kLinear);
  static const std::array<float, 256> gamma22 = table_of(Transfer::kGamma22);
  switch (transfer) {
    case Transfer::kLinear:
      return linear;
    case Transfer::kGamma22:
      return gamma22;
    case Transfer::kSrgb:
      break;
  }
  return srgb;
}

}  // namespace

Transfer transfer_named(const std::string& name) {
  if (name == "srgb") return Transfer::kSrgb;
  if (name == "linear") return Transfer::kLinear;
  if (name == "gamma22") return Transfer::kGamma22;
  throw UsageError("transfer: expected srgb, linear or gamma22, found " + name);
}

float decode_transfer(Transfer transfer, float value) {
  switch (transfer) {
    case Transfer::kLinear:
      return value;
    case Transfer::kGamma22:
      return std::copysign(std::pow(std::abs(value), 2.2f), value);
    case Transfer::kSrgb:
      break;
  }
  return linear_from_srgb(value);
}

float encode_transfer(Transfer transfer, float luminance) {
  switch (transfer) {
    case Transfer::kLinear:
      return luminance;
    case Transfer::kGamma22:
      return std::copysign(std::pow(std::abs(luminance), 1 / 2.2f), luminance);
    case Transfer::kSrgb:
      break;
  }
  return srgb_from_linear(luminance);
}

float MonoImage::stored_luminance(std::size_t index) const {
  switch (depth) {
    case PixelDepth::kU8:
      return decode_table(transfer)[u8[index]];
    case PixelDepth::kU16:
      return decode_transfer(transfer, float(u16[index]) / 65535.0f);
    case PixelDepth::kF32:
      break;
  }
  return f32[index];
}

std::size_t bytes_of(const MonoImage& image) {
  return image.u8.size() + image.u16.size() * sizeof(std::uint16_t) + image.f32.size() * sizeof(float) +
         image.alpha.size() + image.mask.size();
}

std::vector<float> luminance_plane(const MonoImage& image) {
  std::vector<float> luminance(image.pixel_count());
  for (std::size_t i = 0; i < luminance.size(); ++i) luminance[i] = image.luminance(i);
  return luminance;
}

}  // namespace cnerf
