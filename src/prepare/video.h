#pragma once
/// A film clip on its way to images of a capture: shots, the frames worth keeping, borders, fields.

#include <filesystem>
#include <string>
#include <vector>

#include "src/base/options.h"
#include "src/base/progress.h"
#include "src/prepare/film.h"
#include "src/prepare/photographs.h"

namespace cnerf::prepare {

struct VideoOptions {
  int shot = 0;
  int frames = 60;
  std::string video_range = "auto";
  bool allow_no_parallax = false;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("shot", shot, Range{0, 100000},
      "shot of a clip to use, 1 is the first; 0 = the longest in which the camera travels");
    v("frames", frames, Range{2, 10000}, "frames of a clip to keep, the sharpest of each window");
    v("video_range", video_range, Choice{"auto", "limited"},
      "codes of black and white: as the clip says, or 16 to 235 that the decoder did not expand");
    v("allow_no_parallax", allow_no_parallax,
      "go on with a shot, or photographs, between which the camera seems only to turn");
  }
};

/// What a shot is good for.
struct ShotReport {
  Shot range;
  int judged = 0;       ///< pairs of frames with enough motion to tell
  double parallax = 0;  ///< share of them with parallax
  double moved = -1;    ///< median displacement of places, share of the diagonal; -1: none could be followed
  int duplicates = 0;

  /// Why the shot cannot be reconstructed; empty if it can.
  [[nodiscard]] std::string refusal() const;
};

struct ClipReport {
  int width = 0, height = 0, frames = 0;  ///< as stored; frames that could be read
  double fps = 0;
  double pixel_aspect = 1;  ///< width over height of a pixel
  bool interlaced = false;
  double combed = 0;  ///< share of frames woven of two moments
  cv::Rect picture;   ///< what is kept of a frame
  std::vector<ShotReport> shots;
  int shot = 0;           ///< the one used, counted from 1
  std::vector<int> kept;  ///< frame numbers
};

struct ClipImport {
  PhotographSet set;
  ClipReport report;
};

/// True for a file that OpenCV can open as a video; by content, not by name.
[[nodiscard]] bool is_clip(const std::filesystem::path& file);

/// Reads the clip twice: once to judge every frame, once to write those worth keeping to `capture/images`. Borders are
/// cropped with the principal point kept; of interlaced frames one field is kept, with pixels twice as high; nothing is
/// resampled.
/// @param masks  a picture of the size of a frame, black = ignore in every frame (a logo, a time code), or a folder of
///               pictures named as the kept frames (frame_000123.png); empty: none.
/// @throws InputError   no clip, too few frames, a mask of another size.
/// @throws UsageError   no such shot, levels that 8 bits cannot have.
/// @throws PosesError   a shot without parallax or motion, with the reason.  @throws Interrupted.
[[nodiscard]] ClipImport import_clip(const std::filesystem::path& clip, const std::filesystem::path& capture,
                                     const std::filesystem::path& masks, const VideoOptions& options,
                                     const SensorOptions& sensor, const ProgressSink& progress);

/// The shots as lines for the user, each with its frames, seconds and what speaks against it.
[[nodiscard]] std::vector<std::string> shot_lines(const ClipReport& report);

}  // namespace cnerf::prepare
