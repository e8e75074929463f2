#include "src/capture/exr_io.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfStdIO.h>
#include <ImfVersion.h>
#include <ImfXdr.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <optional>
#include <string>

#include "src/base/error.h"
#include "src/base/files.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

constexpr std::int64_t kSmallPicture = 1 << 24;  ///< pixels that are taken for any file
constexpr std::int64_t kMostAroundData = 64;     ///< pixels of larger pictures for each one that is stored
constexpr std::int64_t kMostPerByte = 1 << 16;   ///< stored pixels of larger pictures for each byte of the file

struct Extent {
  std::int64_t width = 0, height = 0;
};

Extent extent_of(const Imath::Box2i& window) {
  return {std::int64_t(window.max.x) - window.min.x + 1, std::int64_t(window.max.y) - window.min.y + 1};
}

/// Text up to the next zero byte; nothing behind the end of the file, or where it is longer than any of the format.
std::optional<std::string> next_text(std::ifstream& in) {
  constexpr std::size_t kLongest = 255;
  std::string text;
  for (int c = in.get(); c > 0 && text.size() <= kLongest; c = in.get()) text += char(c);
  return in && text.size() <= kLongest ? std::optional(text) : std::nullopt;
}

/// The attributes of a file's headers: name, type, size and so many bytes. The library takes memory for whatever size
/// they state.
void check_attributes(const fs::path& file, std::uintmax_t file_bytes, bool has_parts) {
  constexpr std::streamoff kBegin = 8;  // behind the magic number and the version
  std::ifstream in(file, std::ios::binary);
  in.seekg(kBegin);
  for (bool is_first = true;;) {
    const auto name = next_text(in);
    if (name && name->empty()) {  // the end of a header, or of all
      if (!has_parts || is_first) return;
      is_first = true;
      continue;
    }
    is_first = false;
    const auto type = next_text(in);
    std::uint32_t bytes = 0;
    in.read(reinterpret_cast<char*>(&bytes), sizeof bytes);
    if (!name || !type || !in || bytes > file_bytes - std::uintmax_t(in.tellg())) {
      throw InputError(file, "header", "expected an attribute, found the end of the file: it is cut short");
    }
    in.seekg(bytes, std::ios::cur);
  }
}

/// Before the library takes memory for what a header states.
Imf::Header checked_header(const fs::path& file) {
  const std::uintmax_t file_bytes = fs::file_size(file);
  Imf::StdIFStream stream(file.c_str());
  int magic = 0, version = 0;
  Imf::Xdr::read<Imf::StreamIO>(stream, magic);
  Imf::Xdr::read<Imf::StreamIO>(stream, version);
  if (magic != Imf::MAGIC) throw InputError(file, "", "expected an OpenEXR file, found other bytes");
  check_attributes(file, file_bytes, Imf::isMultiPart(version));
  Imf::Header header;
  header.readFrom(stream, version);
  const Extent display = extent_of(header.displayWindow()), data = extent_of(header.dataWindow());
  check_image_size(file, display.width, display.height, "displayWindow");
  check_image_size(file, data.width, data.height, "dataWindow");
  const std::int64_t pixels = display.width * display.height;
  if (pixels > kSmallPicture && pixels / kMostAroundData > data.width * data.height) {
    throw InputError(file, "displayWindow",
                     "expected at most " + std::to_string(kMostAroundData) + " times the pixels of the dataWindow, " +
                         size_text(data.width, data.height) + ", found " + size_text(display.width, display.height));
  }
  const std::int64_t stored = data.width * data.height;
  if (stored > kSmallPicture && std::uintmax_t(stored / kMostPerByte) > file_bytes) {
    throw InputError(file, "dataWindow",
                     "expected at most " + std::to_string(kMostPerByte) + " pixels for each of the file's " +
                         std::to_string(file_bytes) + " bytes, found " + size_text(data.width, data.height));
  }
  return header;
}

/// Reads one channel of the data window into every `stride`-th float of `target`, which is laid out as the display
/// window; what the data window leaves out stays 0.
void read_channel(Imf::InputFile& input, const char* name, float* target, int stride) {
  const Imath::Box2i data = input.header().dataWindow();
  const Imath::Box2i display = input.header().displayWindow();
  const std::size_t width = std::size_t(extent_of(data).width), height = std::size_t(extent_of(data).height);
  std::vector<float> values(width * height);
  Imf::FrameBuffer frame;
  frame.insert(name, Imf::Slice::Make(Imf::FLOAT, values.data(), data, sizeof(float), sizeof(float) * width));
  input.setFrameBuffer(frame);
  input.readPixels(data.min.y, data.max.y);

  const std::size_t display_width = std::size_t(extent_of(display).width);
  for (int y = std::max(data.min.y, display.min.y); y <= std::min(data.max.y, display.max.y); ++y) {
    for (int x = std::max(data.min.x, display.min.x); x <= std::min(data.max.x, display.max.x); ++x) {
      const std::size_t to = std::size_t(y - display.min.y) * display_width + std::size_t(x - display.min.x);
      target[to * std::size_t(stride)] = values[std::size_t(y - data.min.y) * width + std::size_t(x - data.min.x)];
    }
  }
}

std::string channel_names(const Imf::ChannelList& channels) {
  std::string names;
  for (auto i = channels.begin(); i != channels.end(); ++i) names += (names.empty() ? "" : " ") + std::string(i.name());
  return names;
}

/// @throws InputError  when there is neither Y nor R, G and B.
bool has_color(const Imf::ChannelList& channels, const fs::path& file) {
  if (channels.findChannel("R") && channels.findChannel("G") && channels.findChannel("B")) return true;
  if (channels.findChannel("Y") != nullptr) return false;
  throw InputError(file, "channels", "expected Y or R G B, found " + channel_names(channels));
}

LinearImage read_picture(Imf::InputFile& input, const ImageHeader& header) {
  LinearImage image = {header.width, header.height, header.has_color ? 3 : 1, PixelDepth::kF32, {}, {}};
  image.values.resize(image.pixel_count() * std::size_t(image.channels));
  if (header.has_color) {
    read_channel(input, "R", image.values.data(), 3);
    read_channel(input, "G", image.values.data() + 1, 3);
    read_channel(input, "B", image.values.data() + 2, 3);
  } else {
    read_channel(input, "Y", image.values.data(), 1);
  }
  if (header.has_alpha) {
    image.alpha.resize(image.pixel_count());
    read_channel(input, "A", image.alpha.data(), 1);
  }
  return image;
}

/// What the library throws as an error that names the file.
template <typename Read>
auto guarded(const fs::path& file, Read&& read) {
  if (!fs::exists(file)) throw MissingInputError(file.string() + ": no such file");
  try {
    return read();
  } catch (const Error&) {
    throw;
  } catch (const std::exception& failure) {
    throw InputError(file, "", std::string("cannot be read: ") + failure.what());
  }
}

}  // namespace

bool is_exr(const fs::path& file) {
  return lower_extension(file) == ".exr";
}

ImageHeader exr_header(const fs::path& file) {
  return guarded(file, [&] {
    const Imf::Header header = checked_header(file);
    const Extent size = extent_of(header.displayWindow());
    return ImageHeader{int(size.width), int(size.height), PixelDepth::kF32, has_color(header.channels(), file),
                       header.channels().findChannel("A") != nullptr};
  });
}

LinearImage read_exr(const fs::path& file) {
  const ImageHeader header = exr_header(file);
  return guarded(file, [&] {
    Imf::InputFile input(file.c_str());
    return read_picture(input, header);
  });
}

}  // namespace cnerf
