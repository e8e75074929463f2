#pragma once
/// One channel of an OpenEXR file, e.g. a depth.

#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>

#include <filesystem>
#include <vector>

namespace cnerf::test {

struct ExrChannel {
  int width = 0, height = 0;
  std::vector<float> values;  ///< [H, W]
};

inline ExrChannel read_exr_channel(const std::filesystem::path& file, const char* name) {
  Imf::InputFile input(file.c_str());
  const Imath::Box2i window = input.header().dataWindow();
  ExrChannel channel{window.max.x - window.min.x + 1, window.max.y - window.min.y + 1, {}};
  channel.values.resize(std::size_t(channel.width) * std::size_t(channel.height));
  Imf::FrameBuffer frame;
  frame.insert(name, Imf::Slice::Make(Imf::FLOAT, channel.values.data(), window, sizeof(float),
                                      sizeof(float) * std::size_t(channel.width)));
  input.setFrameBuffer(frame);
  input.readPixels(window.min.y, window.max.y);
  return channel;
}

}  // namespace cnerf::test
