#include "export/exr_writer.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfOutputFile.h>
#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>
#include <ImfTiledOutputFile.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/files.h"

namespace cnerf::exporting {
namespace {

constexpr float kLargestHalf = 65504;
constexpr int kTileSide = 64;

/// The library's files go to memory first: a full disk is then noticed where all our files are written.
class MemoryStream : public Imf::OStream {
 public:
  MemoryStream() : Imf::OStream("memory") {}
  void write(const char text[], int n) override {
    bytes_.resize(std::max(bytes_.size(), at_ + std::size_t(n)));
    std::memcpy(bytes_.data() + at_, text, std::size_t(n));
    at_ += std::size_t(n);
  }
  std::uint64_t tellp() override { return at_; }
  void seekp(std::uint64_t position) override { at_ = position; }
  [[nodiscard]] std::span<const std::byte> bytes() const { return bytes_; }

 private:
  std::vector<std::byte> bytes_;
  std::size_t at_ = 0;
};

/// One level of an image, its channels one after another.
struct Level {
  int width = 0, height = 0;
  std::vector<std::vector<float>> planes;
};

Level first_level(const ExrImage& image) {
  const std::size_t pixels = std::size_t(image.width) * image.height;
  Level level{image.width, image.height, {}};
  for (const ExrChannel& channel : image.channels) {
    CNERF_CHECK(channel.values.size() > (pixels - 1) * channel.stride, "channel " + channel.name + " is too short");
    std::vector<float> plane(pixels);
    for (std::size_t i = 0; i < pixels; ++i) {
      const float value = channel.values[i * channel.stride];
      CNERF_CHECK(std::isfinite(value), "channel " + channel.name + " holds a value that is not finite");
      plane[i] = channel.half ? std::clamp(value, -kLargestHalf, kLargestHalf) : value;
    }
    level.planes.push_back(std::move(plane));
  }
  return level;
}

/// Half the size, rounded down.
Level next_level(const Level& level) {
  Level next{std::max(1, level.width / 2), std::max(1, level.height / 2), {}};
  for (const std::vector<float>& plane : level.planes) {
    std::vector<float> smaller;
    for (int y = 0; y < next.height; ++y) {
      for (int x = 0; x < next.width; ++x) {
        double sum = 0;
        for (int s = 0; s < 4; ++s) {
          const int from_x = std::min(2 * x + (s & 1), level.width - 1),
                    from_y = std::min(2 * y + s / 2, level.height - 1);
          sum += plane[std::size_t(from_y) * level.width + from_x];
        }
        smaller.push_back(float(sum / 4));
      }
    }
    next.planes.push_back(std::move(smaller));
  }
  return next;
}

Imf::Header header_of(const ExrImage& image) {
  Imf::Header header(image.width, image.height);
  header.compression() = Imf::ZIP_COMPRESSION;
  Imf::addChromaticities(header, Imf::Chromaticities());  // the default is Rec.709 and D65
  for (const auto& [name, text] : image.attributes) header.insert(name, Imf::StringAttribute(text));
  for (const ExrChannel& channel : image.channels) {
    header.channels().insert(channel.name, Imf::Channel(channel.half ? Imf::HALF : Imf::FLOAT));
  }
  return header;
}

/// A level's pixels in the types of the file; owns the 16-bit copies.
class LevelBuffer {
 public:
  LevelBuffer(const ExrImage& image, Level& level) {
    halves_.reserve(level.planes.size());
    const auto width = std::size_t(level.width);
    for (std::size_t c = 0; c < level.planes.size(); ++c) {
      const std::string& name = image.channels[c].name;
      if (image.channels[c].half) {
        halves_.emplace_back(level.planes[c].begin(), level.planes[c].end());
        frame_.insert(name, Imf::Slice(Imf::HALF, reinterpret_cast<char*>(halves_.back().data()), sizeof(half),
                                       sizeof(half) * width));
      } else {
        frame_.insert(name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(level.planes[c].data()), sizeof(float),
                                       sizeof(float) * width));
      }
    }
  }
  [[nodiscard]] const Imf::FrameBuffer& frame() const { return frame_; }

 private:
  std::vector<std::vector<half>> halves_;
  Imf::FrameBuffer frame_;
};

void write_lines(const ExrImage& image, MemoryStream& stream) {
  Level level = first_level(image);
  const LevelBuffer buffer(image, level);
  Imf::OutputFile out(stream, header_of(image));
  out.setFrameBuffer(buffer.frame());
  out.writePixels(image.height);
}

void write_tiles(const ExrImage& image, MemoryStream& stream) {
  Imf::Header header = header_of(image);
  header.setTileDescription(Imf::TileDescription(kTileSide, kTileSide, Imf::MIPMAP_LEVELS, Imf::ROUND_DOWN));
  Imf::TiledOutputFile out(stream, header);
  Level level = first_level(image);
  for (int number = 0; number < out.numLevels(); ++number) {
    if (number > 0) level = next_level(level);
    const LevelBuffer buffer(image, level);
    out.setFrameBuffer(buffer.frame());
    out.writeTiles(0, out.numXTiles(number) - 1, 0, out.numYTiles(number) - 1, number);
  }
}

}  // namespace

void write_exr(const std::filesystem::path& file, const ExrImage& image, bool mip) {
  CNERF_CHECK(image.width > 0 && image.height > 0 && !image.channels.empty(), "an empty image cannot be written");
  MemoryStream stream;
  try {
    if (mip) {
      write_tiles(image, stream);
    } else {
      write_lines(image, stream);
    }
  } catch (const Iex::BaseExc& failure) {
    throw OutputError(file.string() + ": cannot be written: " + failure.what());
  }
  write_file(file, stream.bytes());
}

}  // namespace cnerf::exporting
