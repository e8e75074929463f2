#include "export/texture_writer.h"

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
#include "src/color/colorspace_math.h"
#include "src/picture/encode.h"

namespace cnerf::exporting {
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

std::vector<float> lightness_of(const std::vector<float>& luminance) {
  std::vector<float> lightness;
  for (const float y : luminance) lightness.push_back(lightness_from_luminance(y));
  return lightness;
}

/// OpenEXR 3.1 says nothing where memory does not suffice to compress the last lines: the file lacks them.
void expect_all_lines(std::span<const std::byte> bytes) {
  Imf::StdISStream stream;
  stream.str({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
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

std::vector<std::byte> basecolor_png(const bake::Texture& texture) {
  const std::span<const float> rgb(&texture.rgb[0].x, 3 * texture.rgb.size());
  CNERF_CHECK(std::ranges::all_of(rgb, [](float value) { return std::isfinite(value); }),
              "a texture holds a value that is not finite");
  return png_bytes(picture_from_linear(texture.size, texture.size, rgb), PngEffort::kBytes);
}

TextureFiles write_exr_textures(const bake::Texture& texture, const std::string& color_origin,
                                const std::filesystem::path& folder, const std::string& name) {
  TextureFiles files{folder / (name + "_rgb.exr"), folder / (name + "_lum.exr"), folder / (name + "_lab.exr")};
  const std::span<const float> rgb(&texture.rgb[0].x, 3 * texture.rgb.size());
  const std::vector<float> lightness = lightness_of(texture.luminance);
  const auto write = [&](const std::filesystem::path& file, const char* space, std::vector<ExrChannel> channels) {
    write_exr(file, {texture.size,
                     texture.size,
                     std::move(channels),
                     {{"software", "cnerf " CNERF_VERSION}, {"colorOrigin", color_origin}, {"colorSpace", space}}});
  };
  write(files.rgb, "lin_rec709", {{"R", rgb, 3, true}, {"G", rgb.subspan(1), 3, true}, {"B", rgb.subspan(2), 3, true}});
  write(files.luminance, "linear luminance, Rec.709 Y", {{"Y", texture.luminance}});
  write(files.lab, "CIE 1976 L*a*b*, D65, 2 degrees; data, not colour",
        {{"Lab.L", lightness}, {"Lab.a", texture.a}, {"Lab.b", texture.b}});
  return files;
}

}  // namespace cnerf::exporting
