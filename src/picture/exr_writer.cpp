#include "src/picture/exr_writer.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfStandardAttributes.h>
#include <ImfStdIO.h>
#include <ImfStringAttribute.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <new>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/files.h"

namespace cnerf {
namespace {

constexpr float kLargestHalf = 65504;

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

/// A channel's pixels in the type that the file has for them.
template <typename Stored>
std::vector<Stored> stored(const ExrChannel& channel, std::size_t pixels) {
  CNERF_CHECK(channel.values.size() > (pixels - 1) * channel.stride, "channel " + channel.name + " is too short");
  std::vector<Stored> plane;
  plane.reserve(pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    const float value = channel.values[i * channel.stride];
    CNERF_CHECK(std::isfinite(value), "channel " + channel.name + " holds a value that is not finite");
    plane.push_back(Stored(channel.half ? std::clamp(value, -kLargestHalf, kLargestHalf) : value));
  }
  return plane;
}

template <typename Stored>
Imf::Slice slice_of(std::vector<Stored>& plane, int width) {
  return {sizeof(Stored) == sizeof(half) ? Imf::HALF : Imf::FLOAT, reinterpret_cast<char*>(plane.data()),
          sizeof(Stored), sizeof(Stored) * std::size_t(width)};
}

/// OpenEXR 3.1 says nothing where memory does not suffice to compress the last lines: the file lacks them.
void expect_all_lines(std::span<const std::byte> bytes) {
  Imf::StdISStream stream;
  stream.str(text_of(bytes));
  if (!Imf::InputFile(stream).isComplete()) throw std::bad_alloc();
}

}  // namespace

void write_exr(const std::filesystem::path& file, const ExrImage& image) {
  CNERF_CHECK(image.width > 0 && image.height > 0 && !image.channels.empty(), "an empty image cannot be written");
  const std::size_t pixels = std::size_t(image.width) * image.height;
  Imf::FrameBuffer frame;
  std::vector<std::vector<half>> halves(image.channels.size());
  std::vector<std::vector<float>> floats(image.channels.size());
  for (std::size_t c = 0; c < image.channels.size(); ++c) {
    const ExrChannel& channel = image.channels[c];
    if (channel.half) {
      halves[c] = stored<half>(channel, pixels);
      frame.insert(channel.name, slice_of(halves[c], image.width));
    } else {
      floats[c] = stored<float>(channel, pixels);
      frame.insert(channel.name, slice_of(floats[c], image.width));
    }
  }
  MemoryStream stream;
  try {
    {
      Imf::OutputFile out(stream, header_of(image));
      out.setFrameBuffer(frame);
      out.writePixels(image.height);
    }
    expect_all_lines(stream.bytes());
  } catch (const Iex::BaseExc& failure) {
    throw OutputError(file.string() + ": cannot be written: " + failure.what());
  }
  write_file(file, stream.bytes());
}

}  // namespace cnerf
