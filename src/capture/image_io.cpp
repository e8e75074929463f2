#include "src/capture/image_io.h"

#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/capture/exr_io.h"
#include "src/color/colorspace_math.h"
#include "src/picture/codecs.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

/// True for a JPEG file without its end-of-image marker. libjpeg fills the rest with grey and only warns.
bool is_truncated_jpeg(const std::vector<std::byte>& content) {
  const auto byte = [&](std::size_t i) { return std::to_integer<unsigned>(content[i]); };
  if (content.size() < 4 || byte(0) != 0xFF || byte(1) != 0xD8) return false;
  std::size_t at = 2;
  while (at + 4 <= content.size() && byte(at) == 0xFF && byte(at + 1) != 0xDA) {  // segments up to the scan
    if (byte(at + 1) == 0xFF) {
      ++at;  // a fill byte
      continue;
    }
    at += 2 + (byte(at + 2) << 8 | byte(at + 3));
  }
  for (; at + 1 < content.size(); ++at) {
    if (byte(at) == 0xFF && byte(at + 1) == 0xD9) return false;
  }
  return true;
}

cv::Mat decode_file(const fs::path& file, int flags) {
  (void)stated_header(file);  // which refuses a size that no picture has
  const std::vector<std::byte> content = read_binary_file(file);
  if (content.empty()) throw InputError(file, "", "expected an image, found an empty file");
  if (is_truncated_jpeg(content)) throw InputError(file, "", "the image is cut short");
  cv::Mat image;
  try {
    const cv::Mat bytes(1, int(content.size()), CV_8U, const_cast<std::byte*>(content.data()));
    image = decode_image(bytes, flags);
  } catch (const cv::Exception& failure) {
    throw InputError(file, "", std::string("the image cannot be decoded: ") + failure.what());
  }
  if (image.empty()) throw InputError(file, "", "expected an image, found other or truncated data");
  check_image_size(file, image.cols, image.rows);
  return image;
}

/// Linear light of every code of an integer depth.
std::vector<float> linear_codes(std::size_t codes, Transfer transfer) {
  std::vector<float> table(codes);
  for (std::size_t i = 0; i < codes; ++i) table[i] = decode_transfer(transfer, float(i) / float(codes - 1));
  return table;
}

/// Copies OpenCV's B G R A pixels into an image; `linear` and `coverage` turn a stored value into light and alpha.
template <typename T, typename Linear, typename Coverage>
void fill(LinearImage& image, const cv::Mat& pixels, Linear&& linear, Coverage&& coverage) {
  const int stored = pixels.channels();
  image.channels = stored >= 3 ? 3 : 1;
  const bool has_alpha = stored == 2 || stored == 4;
  image.values.resize(image.pixel_count() * std::size_t(image.channels));
  if (has_alpha) image.alpha.resize(image.pixel_count());
  std::size_t out = 0;
  for (int y = 0; y < image.height; ++y) {
    const T* row = pixels.ptr<T>(y);
    for (int x = 0; x < image.width; ++x) {
      const T* pixel = row + x * stored;
      const float alpha = has_alpha ? coverage(pixel[stored - 1]) : 1.0f;
      if (has_alpha) image.alpha[std::size_t(y) * std::size_t(image.width) + std::size_t(x)] = alpha;
      for (int c = image.channels; c-- > 0;) image.values[out++] = linear(pixel[c]) * alpha;
    }
  }
}

/// The sun is 10^5 times as bright as white paper under it; far beyond that a training only diverges.
constexpr float kMostLight = 1e6f;

void refuse_implausible(const std::vector<float>& pixels, const fs::path& file) {
  for (const float v : pixels) {
    if (std::abs(v) <= kMostLight) continue;
    throw InputError(file, "pixels", fmt::format("expected values within +-10^6 (1 is white), found {}", v));
  }
}

LinearImage read_with_opencv(const fs::path& file, Transfer transfer) {
  const cv::Mat pixels = decode_file(file, cv::IMREAD_UNCHANGED);  // which leaves the EXIF orientation alone
  LinearImage image;
  image.width = pixels.cols;
  image.height = pixels.rows;
  switch (pixels.depth()) {
    case CV_8U: {
      const std::vector<float> table = linear_codes(256, transfer);
      image.depth = PixelDepth::kU8;
      fill<std::uint8_t>(
          image, pixels, [&](std::uint8_t v) { return table[v]; }, [](std::uint8_t v) { return float(v) / 255.0f; });
      return image;
    }
    case CV_16U: {
      const std::vector<float> table = linear_codes(65536, transfer);
      image.depth = PixelDepth::kU16;
      fill<std::uint16_t>(
          image, pixels, [&](std::uint16_t v) { return table[v]; },
          [](std::uint16_t v) { return float(v) / 65535.0f; });
      return image;
    }
    case CV_32F:
      image.depth = PixelDepth::kF32;
      fill<float>(
          image, pixels, [](float v) { return v; }, [](float v) { return v; });
      return image;
    default:
      throw InputError(file, "pixels", "expected 8 or 16 bits unsigned or 32-bit float, found another type");
  }
}

std::vector<float> area_resized_plane(const std::vector<float>& values, int channels, cv::Size from, cv::Size to) {
  const cv::Mat source(from, CV_32FC(channels), const_cast<float*>(values.data()));
  std::vector<float> out(std::size_t(to.area()) * std::size_t(channels));
  cv::Mat target(to, CV_32FC(channels), out.data());
  cv::resize(source, target, to, 0, 0, cv::INTER_AREA);
  return out;
}

double white_of(const cv::Mat& mask) {
  return mask.depth() == CV_8U ? 255 : mask.depth() == CV_16U ? 65535 : 1;
}

/// A mask of ones, or of bytes in 16 bits, would hide everything, though it is not black. A soft one without white is
/// of a view that does not show what is masked for.
void refuse_ones(const cv::Mat& mask, const fs::path& file) {
  double lightest = 0;
  cv::minMaxLoc(mask, nullptr, &lightest);
  const double most_of_ones = mask.depth() == CV_8U ? 1 : mask.depth() == CV_16U ? 255 : 0;
  if (lightest <= 0 || lightest > most_of_ones) return;
  throw InputError(file, "values",
                   fmt::format("expected black and white, the lightest is {:g} of {:g}", lightest, white_of(mask)));
}

template <typename T>
T quantised(float value, float largest) {
  return T(std::lround(std::clamp(value, 0.0f, 1.0f) * largest));
}

/// Bytes of linear light: what rounding `encode_transfer` gives, without a power for every pixel.
class ByteEncoder {
 public:
  explicit ByteEncoder(Transfer transfer) {
    const auto rounded = [&](float light) { return quantised<std::uint8_t>(encode_transfer(transfer, light), 255.0f); };
    for (int code = 1; code < 256; ++code) {
      std::uint32_t below = 0, above = std::bit_cast<std::uint32_t>(1.0f);  // bits of floats >= 0 are in their order
      while (above - below > 1) {
        const std::uint32_t middle = below + (above - below) / 2;
        (rounded(std::bit_cast<float>(middle)) >= code ? above : below) = middle;
      }
      least_light_[std::size_t(code)] = std::bit_cast<float>(above);
    }
    for (std::size_t cell = 0; cell < kCells; ++cell) first_code_[cell] = rounded(float(cell) / kCells);
  }

  std::uint8_t operator()(float light) const {
    light = std::clamp(light, 0.0f, 1.0f);
    std::size_t code = first_code_[std::min(std::size_t(light * kCells), kCells - 1)];
    while (code < 255 && light >= least_light_[code + 1]) ++code;
    return std::uint8_t(code);
  }

 private:
  static constexpr std::size_t kCells = 4096;    ///< of light, most of them less than a code wide
  std::array<float, 256> least_light_{};         ///< of every code
  std::array<std::uint8_t, kCells> first_code_;  ///< of every cell
};

}  // namespace

LinearImage read_linear_image(const fs::path& file, Transfer transfer) {
  LinearImage image = is_exr(file) ? read_exr(file) : read_with_opencv(file, transfer);
  if (image.depth == PixelDepth::kF32) {
    refuse_implausible(image.values, file);
    refuse_implausible(image.alpha, file);
  }
  return image;
}

ImageHeader image_header(const LinearImage& image) {
  return {image.width, image.height, image.depth, image.channels == 3, !image.alpha.empty()};
}

ImageHeader image_header(const fs::path& file) {
  const auto stated = stated_header(file);
  return stated ? *stated : image_header(read_linear_image(file, Transfer::kLinear));
}

bool is_monochrome(const LinearImage& image) {
  if (image.channels == 1) return true;
  for (std::size_t i = 0; i < image.pixel_count(); ++i) {
    const float* rgb = &image.values[3 * i];
    if (rgb[0] != rgb[1] || rgb[1] != rgb[2]) return false;
  }
  return true;
}

LinearImage luminance_image(LinearImage image) {
  if (image.channels == 1) return image;
  for (std::size_t i = 0; i < image.pixel_count(); ++i) {
    const float* rgb = &image.values[3 * i];
    image.values[i] = luminance_of<float>({rgb[0], rgb[1], rgb[2]});
  }
  image.channels = 1;
  image.values.resize(image.pixel_count());
  image.values.shrink_to_fit();
  return image;
}

LinearImage area_resized(const LinearImage& image, int width, int height) {
  CNERF_CHECK(width > 0 && height > 0, "an image has pixels");
  if (width == image.width && height == image.height) return image;
  const cv::Size from(image.width, image.height);
  const cv::Size to(width, height);
  LinearImage out = {width, height, image.channels, image.depth, {}, {}};
  out.values = area_resized_plane(image.values, image.channels, from, to);
  if (!image.alpha.empty()) out.alpha = area_resized_plane(image.alpha, 1, from, to);
  return out;
}

MonoImage encode_mono(const LinearImage& image, Transfer transfer) {
  CNERF_CHECK_EQ(image.channels, 1);
  MonoImage out;
  out.width = image.width;
  out.height = image.height;
  out.depth = image.depth;
  out.transfer = image.depth == PixelDepth::kF32 ? Transfer::kLinear : transfer;
  const std::size_t n = image.pixel_count();
  switch (image.depth) {
    case PixelDepth::kU8: {
      const ByteEncoder encoder(transfer);
      out.u8.resize(n);
      std::transform(image.values.begin(), image.values.end(), out.u8.begin(), encoder);
      break;
    }
    case PixelDepth::kU16:
      out.u16.resize(n);
      for (std::size_t i = 0; i < n; ++i) {
        out.u16[i] = quantised<std::uint16_t>(encode_transfer(transfer, image.values[i]), 65535.0f);
      }
      break;
    case PixelDepth::kF32:
      out.f32 = image.values;
      break;
  }
  out.alpha.resize(image.alpha.size());
  for (std::size_t i = 0; i < image.alpha.size(); ++i) out.alpha[i] = quantised<std::uint8_t>(image.alpha[i], 255.0f);
  if (std::all_of(out.alpha.begin(), out.alpha.end(), [](std::uint8_t a) { return a == 255; })) out.alpha.clear();
  return out;
}

std::vector<std::uint8_t> read_mask(const fs::path& file, int width, int height) {
  const auto check_shape = [&](int found_width, int found_height) {
    if (same_shape(width, height, found_width, found_height)) return;
    throw InputError(file, "size",
                     "expected the shape of its image, " + size_text(width, height) + ", found " +
                         size_text(found_width, found_height));
  };
  if (const auto header = stated_header(file)) check_shape(header->width, header->height);
  constexpr int kGrey = cv::IMREAD_GRAYSCALE | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION;
  const cv::Mat stored = decode_file(file, kGrey);
  check_shape(stored.cols, stored.rows);
  refuse_ones(stored, file);
  cv::Mat binary = (stored > 0.5 * white_of(stored)) / 255;  // lossy masks are not exactly black and white
  cv::Mat counts;
  binary.convertTo(counts, CV_32F);
  if (stored.cols != width) cv::resize(counts, counts, {width, height}, 0, 0, cv::INTER_AREA);
  std::vector<std::uint8_t> mask(std::size_t(width) * std::size_t(height));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      mask[std::size_t(y) * std::size_t(width) + std::size_t(x)] = counts.at<float>(y, x) > 0.999f ? 255 : 0;
    }
  }
  return mask;
}

bool same_shape(int width, int height, int stated_width, int stated_height) {
  if (std::int64_t(width) * stated_height == std::int64_t(height) * stated_width) return true;
  // A copy reduced by an integer, each side rounded up or down.
  const auto is_nth = [](int reduced, int full, int n) { return std::abs(double(full) / n - reduced) < 1.0; };
  for (int n = 2; n <= 64; ++n) {
    if (is_nth(width, stated_width, n) && is_nth(height, stated_height, n)) return true;
  }
  return false;
}

}  // namespace cnerf
