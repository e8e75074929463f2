#pragma once
/// Rendered views as files.

#include <filesystem>
#include <memory>

#include "src/capture/mono_image.h"
#include "src/picture/picture.h"
#include "src/render/camera_path.h"
#include "src/train/scene.h"

namespace cnerf::pipeline {

/// Which colour of a rendered view is shown.
enum class ShownColor {
  kDecoded,  ///< the per-pixel decode; luminance where the view has no colour
  kBaked,    ///< composited per-sample colour, as a bake shows it
};

/// 8-bit sRGB of the luminance.
[[nodiscard]] Picture grey_picture(const MonoImage& image);
/// Linear Rec.709 over black, [H, W, 3].
[[nodiscard]] std::vector<float> shown_rgb(const RenderedImage& image, ShownColor color);
/// 8-bit sRGB over black.
[[nodiscard]] Picture picture_of(const RenderedImage& image, ShownColor color);

/// R G B A half (linear Rec.709, premultiplied), Z float (distance along the optical axis, world units, 0 = none), with
/// the chromaticities attribute and what is said of the colours' origin.  @throws OutputError.
void write_exr(const std::filesystem::path& file, const RenderedImage& image, ShownColor color,
               const std::string& color_origin = {});

/// Removes the numbered frames of a longer render: those of one kind that the path does not have.
/// @param extension  ".png"  @throws OutputError
void remove_other_frames(const std::filesystem::path& folder, const char* extension, const CameraPath& path);

/// An MPEG-4 video. The file appears under its name when `finish` succeeds.
class VideoFile {
 public:
  VideoFile(const std::filesystem::path& file, int fps);
  ~VideoFile();
  VideoFile(const VideoFile&) = delete;
  VideoFile& operator=(const VideoFile&) = delete;

  /// All pictures have the size of the first. @return false where OpenCV has no encoder or cannot open the file:
  /// the video is then given up.
  [[nodiscard]] bool add(const Picture& picture);
  /// @throws OutputError  when the file did not get whole.
  void finish();

 private:
  struct Encoder;
  std::unique_ptr<Encoder> encoder_;
};

}  // namespace cnerf::pipeline
