#include "src/app/picture_files.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfOutputFile.h>
#include <ImfStandardAttributes.h>
#include <unistd.h>

#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/files.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

constexpr float kLargestHalf = 65504;

struct HalfRgba {
  half r, g, b, a;
};

std::vector<HalfRgba> half_rgba(const RenderedImage& image, ShownColor color) {
  const std::vector<float> rgb = shown_rgb(image, color);
  std::vector<HalfRgba> pixels(image.opacity.size());
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const auto channel = [&](int c) { return half(std::min(rgb[3 * i + c], kLargestHalf)); };
    pixels[i] = {channel(0), channel(1), channel(2), half(image.opacity[i])};
  }
  return pixels;
}

void write_exr_to(const fs::path& file, const RenderedImage& image, ShownColor color) {
  std::vector<HalfRgba> pixels = half_rgba(image, color);
  std::vector<float> depth = image.depth;
  Imf::Header header(image.width, image.height);
  header.compression() = Imf::ZIP_COMPRESSION;
  Imf::addChromaticities(header, Imf::Chromaticities());  // the default is Rec.709 and D65
  Imf::FrameBuffer frame;
  const auto add = [&](const char* name, Imf::PixelType type, void* base, std::size_t stride) {
    header.channels().insert(name, Imf::Channel(type));
    frame.insert(name, Imf::Slice(type, static_cast<char*>(base), stride, stride * std::size_t(image.width)));
  };
  add("R", Imf::HALF, &pixels[0].r, sizeof(HalfRgba));
  add("G", Imf::HALF, &pixels[0].g, sizeof(HalfRgba));
  add("B", Imf::HALF, &pixels[0].b, sizeof(HalfRgba));
  add("A", Imf::HALF, &pixels[0].a, sizeof(HalfRgba));
  add("Z", Imf::FLOAT, depth.data(), sizeof(float));
  Imf::OutputFile out(file.c_str(), header);
  out.setFrameBuffer(frame);
  out.writePixels(image.height);
}

}  // namespace

std::vector<float> shown_rgb(const RenderedImage& image, ShownColor color) {
  if (color == ShownColor::kBaked && !image.baked_rgb.empty()) return image.baked_rgb;
  if (color == ShownColor::kDecoded && !image.rgb.empty()) return image.rgb;
  std::vector<float> grey;
  grey.reserve(3 * image.luminance.size());
  for (const float y : image.luminance) grey.insert(grey.end(), {y, y, y});
  return grey;
}

Picture picture_of(const RenderedImage& image, ShownColor color) {
  return picture_from_linear(image.width, image.height, shown_rgb(image, color));
}

void write_exr(const fs::path& file, const RenderedImage& image, ShownColor color) {
  write_atomically(file, [&](const fs::path& temporary) {
    try {
      write_exr_to(temporary, image, color);
    } catch (const Iex::BaseExc& error) {
      throw OutputError(file.string() + ": cannot be written: " + error.what());
    }
  });
}

struct VideoFile::Encoder {
  fs::path file, temporary;
  int fps = 0;
  cv::Size size;
  cv::VideoWriter writer;
};

VideoFile::VideoFile(const fs::path& file, int fps) : encoder_(std::make_unique<Encoder>()) {
  encoder_->file = file;
  encoder_->temporary = file.parent_path() / ("." + file.stem().string() + ".partial-" + std::to_string(::getpid()) +
                                              file.extension().string());
  encoder_->fps = fps;
}

VideoFile::~VideoFile() {
  encoder_->writer.release();
  std::error_code ignored;
  fs::remove(encoder_->temporary, ignored);
}

bool VideoFile::add(const Picture& picture) {
  if (encoder_->size.empty()) {
    std::error_code ignored;
    fs::create_directories(encoder_->file.parent_path(), ignored);
    encoder_->size = {picture.width, picture.height};
    encoder_->writer.open(encoder_->temporary.string(), cv::VideoWriter::fourcc('m', 'p', '4', 'v'), encoder_->fps,
                          encoder_->size);
  }
  CNERF_CHECK_EQ(encoder_->size.width, picture.width);
  CNERF_CHECK_EQ(encoder_->size.height, picture.height);
  if (!encoder_->writer.isOpened()) return false;
  const cv::Mat rgb(picture.height, picture.width, CV_8UC3, const_cast<std::uint8_t*>(picture.rgb.data()));
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  encoder_->writer.write(bgr);
  return true;
}

void VideoFile::finish() {
  encoder_->writer.release();
  std::error_code failure;
  // OpenCV reports no write errors; a file that cannot be opened again is what a full disk leaves.
  if (!cv::VideoCapture(encoder_->temporary.string()).isOpened()) {
    throw OutputError(encoder_->file.string() + ": cannot be written: the video is not readable, is the disk full?");
  }
  fs::rename(encoder_->temporary, encoder_->file, failure);
  if (failure) throw OutputError(encoder_->file.string() + ": cannot be written: " + failure.message());
}

}  // namespace cnerf
