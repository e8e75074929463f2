#include "src/pipeline/picture_files.h"

#include <algorithm>
#include <opencv2/videoio.hpp>
#include <optional>
#include <span>
#include <vector>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/picture/codecs.h"
#include "src/picture/encode.h"
#include "src/picture/exr_writer.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;

std::vector<float> shown_rgb(const RenderedImage& image, ShownColor color) {
  if (color == ShownColor::kBaked && !image.baked_rgb.empty()) return image.baked_rgb;
  if (color == ShownColor::kDecoded && !image.rgb.empty()) return image.rgb;
  std::vector<float> grey;
  grey.reserve(3 * image.luminance.size());
  for (const float y : image.luminance) grey.insert(grey.end(), {y, y, y});
  return grey;
}

Picture grey_picture(const MonoImage& image) {
  return picture_from_linear(image.width, image.height, luminance_plane(image));
}

Picture picture_of(const RenderedImage& image, ShownColor color) {
  return picture_from_linear(image.width, image.height, shown_rgb(image, color));
}

void write_exr(const fs::path& file, const RenderedImage& image, ShownColor color, const std::string& color_origin) {
  const std::vector<float> values = shown_rgb(image, color);
  const std::span<const float> rgb(values);
  cnerf::write_exr(
      file, {image.width,
             image.height,
             {{"R", rgb, 3, true},
              {"G", rgb.subspan(1), 3, true},
              {"B", rgb.subspan(2), 3, true},
              {"A", image.opacity, 1, true},
              {"Z", image.depth}},
             {{"software", "cnerf " CNERF_VERSION}, {"colorOrigin", color_origin}, {"colorSpace", "lin_rec709"}}});
}

void remove_other_frames(const fs::path& folder, const char* extension, const CameraPath& path) {
  const auto is_other = [&](const fs::path& file) {
    const std::string name = file.stem().string();
    return file.extension() == extension && is_frame_name(name) &&
           std::ranges::find(path.cameras, name, &PathCamera::name) == path.cameras.end();
  };
  std::vector<fs::path> others;
  std::error_code failure;
  for (const auto& entry : fs::directory_iterator(folder, failure)) {
    if (entry.is_regular_file(failure) && is_other(entry.path())) others.push_back(entry.path());
  }
  for (const fs::path& other : others) remove_output(other);
}

struct VideoFile::Encoder {
  fs::path file;
  int fps = 0;
  cv::Size size;
  std::optional<NewFile> output;
  std::shared_ptr<cv::VideoWriter> writer;  ///< goes first
};

VideoFile::VideoFile(const fs::path& file, int fps) : encoder_(std::make_unique<Encoder>()) {
  encoder_->file = file;
  encoder_->fps = fps;
}

VideoFile::~VideoFile() = default;

bool VideoFile::add(const Picture& picture) {
  if (encoder_->size.empty()) {
    encoder_->size = {picture.width, picture.height};
    encoder_->output.emplace(encoder_->file);
    encoder_->writer = create_video(encoder_->output->temporary().string(), encoder_->fps, encoder_->size);
  }
  CNERF_CHECK_EQ(encoder_->size.width, picture.width);
  CNERF_CHECK_EQ(encoder_->size.height, picture.height);
  if (!encoder_->writer->isOpened()) return false;
  encoder_->writer->write(bgr_of(picture));
  return true;
}

void VideoFile::finish() {
  encoder_->writer.reset();
  // OpenCV reports no write errors; a file that cannot be opened again is what a full disk leaves.
  if (!open_video(encoder_->output->temporary().string(), cv::CAP_ANY)->isOpened()) {
    throw OutputError(encoder_->file.string() + ": cannot be written: the video is not readable, is the disk full?");
  }
  encoder_->output->commit();
}

}  // namespace cnerf::pipeline
