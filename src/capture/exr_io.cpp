#include "src/capture/exr_io.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>

#include <algorithm>
#include <string>

#include "src/base/check.h"
#include "src/base/error.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

/// Reads one channel of the data window into every `stride`-th float of `target`, which is laid out as the display
/// window; what the data window leaves out stays 0.
void read_channel(Imf::InputFile& input, const char* name, float* target, int stride) {
  const Imath::Box2i data = input.header().dataWindow();
  const Imath::Box2i display = input.header().displayWindow();
  const int width = data.max.x - data.min.x + 1;
  const int height = data.max.y - data.min.y + 1;
  std::vector<float> values(std::size_t(width) * std::size_t(height));
  Imf::FrameBuffer frame;
  frame.insert(name,
               Imf::Slice::Make(Imf::FLOAT, values.data(), data, sizeof(float), sizeof(float) * std::size_t(width)));
  input.setFrameBuffer(frame);
  input.readPixels(data.min.y, data.max.y);

  const int display_width = display.max.x - display.min.x + 1;
  for (int y = std::max(data.min.y, display.min.y); y <= std::min(data.max.y, display.max.y); ++y) {
    for (int x = std::max(data.min.x, display.min.x); x <= std::min(data.max.x, display.max.x); ++x) {
      const int to = (y - display.min.y) * display_width + (x - display.min.x);
      target[std::size_t(to) * std::size_t(stride)] =
          values[std::size_t(y - data.min.y) * std::size_t(width) + std::size_t(x - data.min.x)];
    }
  }
}

std::string channel_names(const Imf::ChannelList& channels) {
  std::string names;
  for (auto i = channels.begin(); i != channels.end(); ++i) names += (names.empty() ? "" : " ") + std::string(i.name());
  return names;
}

LinearImage empty_image(const Imf::InputFile& input, int channels) {
  const Imath::Box2i display = input.header().displayWindow();
  LinearImage image;
  image.width = display.max.x - display.min.x + 1;
  image.height = display.max.y - display.min.y + 1;
  image.depth = PixelDepth::kF32;
  image.channels = channels;
  image.values.resize(image.pixel_count() * std::size_t(channels));
  return image;
}

LinearImage read_picture(Imf::InputFile& input, const fs::path& file) {
  const Imf::ChannelList& channels = input.header().channels();
  const bool has_color = channels.findChannel("R") && channels.findChannel("G") && channels.findChannel("B");
  if (!has_color && channels.findChannel("Y") == nullptr) {
    throw InputError(file, "channels", "expected Y or R G B, found " + channel_names(channels));
  }
  LinearImage image = empty_image(input, has_color ? 3 : 1);
  if (has_color) {
    read_channel(input, "R", image.values.data(), 3);
    read_channel(input, "G", image.values.data() + 1, 3);
    read_channel(input, "B", image.values.data() + 2, 3);
  } else {
    read_channel(input, "Y", image.values.data(), 1);
  }
  if (channels.findChannel("A") != nullptr) {
    image.alpha.resize(image.pixel_count());
    read_channel(input, "A", image.alpha.data(), 1);
  }
  return image;
}

}  // namespace

LinearImage read_exr(const fs::path& file) {
  if (!fs::exists(file)) throw MissingInputError(file.string() + ": no such file");
  try {
    Imf::InputFile input(file.c_str());
    return read_picture(input, file);
  } catch (const Error&) {
    throw;
  } catch (const std::exception& failure) {
    throw InputError(file, "", std::string("cannot be read: ") + failure.what());
  }
}

void write_exr_channel(const fs::path& file, const char* channel, int width, int height,
                       std::span<const float> values) {
  CNERF_CHECK_EQ(values.size(), std::size_t(width) * std::size_t(height));
  try {
    Imf::Header header(width, height);
    header.compression() = Imf::ZIP_COMPRESSION;
    header.channels().insert(channel, Imf::Channel(Imf::FLOAT));
    Imf::FrameBuffer frame;
    // The library wants a mutable pointer for both directions; it only reads here.
    frame.insert(channel, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(const_cast<float*>(values.data())),
                                     sizeof(float), sizeof(float) * std::size_t(width)));
    Imf::OutputFile output(file.c_str(), header);
    output.setFrameBuffer(frame);
    output.writePixels(height);
  } catch (const std::exception& failure) {
    throw OutputError(file.string() + ": cannot be written: " + failure.what());
  }
}

}  // namespace cnerf
