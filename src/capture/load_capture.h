#pragma once
/// Turns a folder into a Capture, whatever convention it follows.

#include <string>
#include <vector>

#include "src/base/options.h"
#include "src/capture/capture.h"
#include "src/capture/photograph_store.h"

namespace cnerf {

struct CaptureOptions {
  int downscale = 1;
  std::string transfer = "srgb";
  bool cut_out_of_black = true;
  int holdout = 0;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("downscale", downscale, Range{1, 64}, "divide image sizes by this");
    v("transfer", transfer, Choice{"srgb", "linear", "gamma22"}, "how grey values encode luminance");
    v("cut_out_of_black", cut_out_of_black, "where all views show an object before black, take the black as empty");
    v("holdout", holdout, Range{2, 1000, true},
      "hold out every N-th view; 0 follows the data set's own split, if it has one");
  }
};

/// Recognises the format by its marker file and reads it: `transforms.json` or `transforms_train.json` (NeRF,
/// instant-ngp, nerfstudio), a COLMAP model (`cameras.bin|txt` here, or in `sparse/`, `sparse/N/`, `colmap/sparse/N/`),
/// `poses_bounds.npy` (LLFF), `cameras.xml` (Metashape), a `.csv` that begins with `#name` or `.xmp` sidecars here or
/// in `images/` (RealityCapture, RealityScan), `keyframes/corrected_cameras/` or `keyframes/cameras/` (Polycam), or
/// `metadata.json` beside `rgb/` (Record3D). A path to the marker file itself works as well; an `.xml` may have any
/// name.
/// @throws MissingInputError  no such folder, or no marker: the message lists what was looked for.
/// @param memory  for its pixels; images are read one by one on each thread, whatever their number
/// @throws InputError         fewer than 2 usable views, bad poses, truncated files, masks that leave nothing to train
///                            on; names file, field and value.
/// @throws OutputError        pixels are more than their memory and cannot be written to a file.
[[nodiscard]] Capture load_capture(const std::filesystem::path& path, const CaptureOptions& options = {},
                                   const ImageMemory& memory = {});

/// Whether a folder carries poses in one of these conventions, be they whole or not.
[[nodiscard]] bool holds_poses(const std::filesystem::path& folder);

/// The same without pixels, from the headers of the images: views tell size and depth, and what pixels decide (whether
/// the subject is cut out, which images have colours) is left out.  @throws  as `load_capture`, but for bad pixels.
[[nodiscard]] Capture survey_capture(const std::filesystem::path& path, const CaptureOptions& options = {});

/// The photograph of a view as it was given.
struct FullSizeImage {
  std::string view;            ///< its name
  std::filesystem::path file;  ///< the largest there is, whatever `CaptureOptions::downscale`
};
/// One for each view that `load_capture` finds with the same options, in its order. No image is opened.
/// @throws  as `load_capture`, but for bad images.
[[nodiscard]] std::vector<FullSizeImage> full_size_images(const std::filesystem::path& path,
                                                          const CaptureOptions& options = {});

}  // namespace cnerf
