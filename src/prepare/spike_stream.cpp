#include "src/prepare/spike_stream.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/picture/encode.h"
#include "src/prepare/grey_image.h"

namespace cnerf::prepare {
namespace fs = std::filesystem;
namespace {

std::size_t tick_bytes(int width, int height) {
  return (std::size_t(width) * std::size_t(height) + 7) / 8;
}

std::vector<std::byte> read_window(std::ifstream& in, std::size_t begin, std::size_t size, const fs::path& file) {
  std::vector<std::byte> ticks(size);
  in.seekg(std::streamoff(begin));
  in.read(reinterpret_cast<char*>(ticks.data()), std::streamsize(size));
  if (!in) throw InputError(file, "", "cannot be read to its end");
  return ticks;
}

void write_picture(const fs::path& file, const LinearImage& image, bool flip) {
  cv::Mat1w codes(image.height, image.width);
  for (int y = 0; y < image.height; ++y) {
    const int from = flip ? image.height - 1 - y : y;
    for (int x = 0; x < image.width; ++x) {
      const float light = image.values[std::size_t(from) * std::size_t(image.width) + std::size_t(x)];
      codes(y, x) = std::uint16_t(std::lround(65535 * encode_transfer(Transfer::kSrgb, light)));
    }
  }
  write_png(file, codes);
}

}  // namespace

LinearImage integrate_spikes(std::span<const std::byte> ticks, int width, int height, int window) {
  const std::size_t stride = tick_bytes(width, height);
  CNERF_CHECK_EQ(ticks.size(), stride * std::size_t(window));
  LinearImage out;
  out.width = width;
  out.height = height;
  out.depth = PixelDepth::kU16;
  out.values.resize(out.pixel_count());
  parallel_ranges(out.pixel_count(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t pixel = begin; pixel < end; ++pixel) {
      int count = 0, first = 0, last = 0;
      for (int tick = 0; tick < window; ++tick) {
        const auto byte = std::to_integer<unsigned>(ticks[std::size_t(tick) * stride + pixel / 8]);
        if ((byte >> (pixel % 8) & 1u) == 0) continue;
        if (count++ == 0) first = tick;
        last = tick;
      }
      out.values[pixel] = count >= 2 ? float(count - 1) / float(last - first) : float(count) / float(window);
    }
  });
  return out;
}

PhotographSet import_spikes(const fs::path& stream, const fs::path& capture, const SpikeOptions& options, int count,
                            const ProgressSink& progress) {
  const int width = options.spike_width, height = options.spike_height, window = options.spike_window;
  if (width == 0 || height == 0) {
    throw UsageError("spike_width, spike_height: expected the size of the stream " + stream.string() + ", found 0");
  }
  const std::uintmax_t size = fs::file_size(stream), stride = tick_bytes(width, height);
  if (size % stride != 0 || size / stride < 2 * std::uintmax_t(window)) {
    throw InputError(stream, "size",
                     fmt::format("expected whole ticks of {} bytes ({} x {} bits) and at least {}, found {} bytes",
                                 stride, width, height, 2 * window, size));
  }
  const std::uintmax_t ticks = size / stride;
  const auto pictures = int(std::min<std::uintmax_t>(std::uintmax_t(count), ticks / std::uintmax_t(window)));
  std::ifstream in(stream, std::ios::binary);
  PhotographSet set;
  for (int i = 0; i < pictures; ++i) {
    if (interruption_requested()) throw Interrupted("stopped while reading the stream");
    const std::uintmax_t begin = (ticks - std::uintmax_t(window)) * std::uintmax_t(i) / std::uintmax_t(pictures - 1);
    const auto bytes = read_window(in, std::size_t(begin * stride), std::size_t(stride) * std::size_t(window), stream);
    const LinearImage picture = integrate_spikes(bytes, width, height, window);
    PreparedImage image;
    image.name = fmt::format("tick_{:08}.png", begin);
    image.source = stream;
    image.width = width;
    image.height = height;
    image.frame = int(begin);
    image.sharpness = sharpness(grey_codes(picture));
    write_picture(capture / "images" / image.name, picture, options.spike_flip);
    set.images.push_back(std::move(image));
    if (progress) progress({"spikes", double(i + 1) / pictures, {}});
  }
  return set;
}

}  // namespace cnerf::prepare
