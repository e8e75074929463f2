#pragma once
/// Photographs as a user has them, on their way to images of a capture: upright, one channel, at the depth they came
/// in.

#include <cstddef>
#include <filesystem>
#include <map>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "src/base/options.h"
#include "src/base/progress.h"
#include "src/capture/image_io.h"
#include "src/prepare/exif.h"

namespace cnerf::prepare {

/// How stored values become luminance.
struct SensorOptions {
  std::string transfer = "srgb";
  double black_level = 0;
  double white_level = 0;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("transfer", transfer, Choice{"srgb", "linear", "gamma22"}, "how grey values of the source encode luminance");
    v("black_level", black_level, Range{0, 65535}, "code that means no light, of a sensor's raw values");
    v("white_level", white_level, Range{0, 65535},
      "code that means white, e.g. 4095 of 12 bits in 16; 0 = the largest of the file's depth");
  }
};

/// Codes of a source that mean no light and white.
struct Levels {
  double black = 0, white = 0;
};
/// @param largest  code of the source's depth
/// @throws UsageError  unless black is below white, and white a code that the source can have; names the option
[[nodiscard]] Levels levels_of(const SensorOptions& sensor, int largest, const std::filesystem::path& source);

/// One image of the capture to be.
struct PreparedImage {
  std::string name;                   ///< file name below `images/`
  std::filesystem::path source;       ///< photograph, or clip
  std::filesystem::path mask;         ///< below the capture, "masks/NAME.png"; empty: none
  int width = 0, height = 0;          ///< pixels, upright
  int orientation = 1;                ///< of the stored pixels, as EXIF numbers it; 1: upright
  int camera = 0;                     ///< number of its camera: same size, same lens
  double focal = 0;                   ///< pixels, as the notes of the file tell; 0: unknown
  double pixel_aspect = 1;            ///< width of a pixel over its height
  double centre_x = 0, centre_y = 0;  ///< principal point, pixels; 0, 0: the middle
  int uncropped = 0;                  ///< longer side of the frame that borders were cut from, pixels; 0: none were
  double exposure = 1, haze = 0;      ///< see exposure.h
  int frame = -1;                     ///< of a clip: number of the frame in it
  double sharpness = 0;               ///< see grey_image.h; comparable within one capture only
};

struct PhotographSet {
  std::vector<PreparedImage> images;    ///< sorted by name
  std::vector<std::string> unreadable;  ///< "FILE: why", left out
  std::vector<std::string> notes;
};

/// Places of images by what a COLMAP model calls them: their own names, which are all different and go first, those of
/// their photographs, or the stems of either.
class ImagePlaces {
 public:
  explicit ImagePlaces(const std::vector<PreparedImage>& images);
  /// @param name  may have folders
  [[nodiscard]] std::optional<std::size_t> of(const std::string& name) const;

 private:
  std::map<std::string, std::size_t> by_name_, by_stem_;
};

/// The photographs of a folder, sorted; if it holds none itself, those of its `images` folder.
/// @throws MissingInputError  no such folder, or no photograph in it.
/// @throws InputError  HEIC files, with the command that converts them.
[[nodiscard]] std::vector<std::filesystem::path> list_photographs(const std::filesystem::path& folder);

/// True for a folder that `list_photographs` finds something in, be it only what it refuses.
[[nodiscard]] bool holds_photographs(const std::filesystem::path& folder);

/// Writes every photograph to `capture/images`: turned upright as its EXIF note says, colours reduced to luminance,
/// levels applied, never resampled. 8-bit photographs become 8-bit PNG files, deeper ones 16-bit PNG, floats EXR;
/// integer codes are sRGB-encoded whatever the source was.
/// @param masks  folder of masks named as the photographs (any image extension), black = ignore; empty: none. They have
///               the stored pixels of the photograph; of one on its side (EXIF 5 to 8) also those that are shown, and
///               of a TIFF those that are shown.
/// @throws MissingInputError  a mask folder without a mask.  @throws InputError  when fewer than 2 can be read, or a
/// mask does not fit.  @throws UsageError  levels that a photograph cannot have.  @throws Interrupted.
[[nodiscard]] PhotographSet import_photographs(const std::vector<std::filesystem::path>& files,
                                               const std::filesystem::path& capture, const std::filesystem::path& masks,
                                               const SensorOptions& sensor, const ProgressSink& progress);

/// Masks of a folder by the stem of the picture they belong to; "0001.jpg.png", as COLMAP names them, belongs to
/// "0001". None for an empty path.  @throws MissingInputError  no such folder, or no picture in it.
[[nodiscard]] std::map<std::string, std::filesystem::path> masks_in(const std::filesystem::path& folder);

/// How pixels that `read_linear_image` gives of a photograph have to be turned to stand upright, as EXIF numbers it.
/// @param file  its content
[[nodiscard]] int orientation_of(std::span<const std::byte> file);

/// The whole image of such pixels. A cv::Mat that stands upright already shares its own.
[[nodiscard]] cv::Mat turned_upright(const cv::Mat& stored, int orientation);
[[nodiscard]] LinearImage turned_upright(LinearImage stored, int orientation);

}  // namespace cnerf::prepare
