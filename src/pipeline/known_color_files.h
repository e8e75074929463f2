#pragma once
/// Key frames and hints as a user names them, made into colours of views.

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "src/capture/capture.h"
#include "src/config/config.h"
#include "src/train/chroma/known_colors.h"

namespace cnerf::pipeline {

struct GivenColors {
  std::vector<KnownColors> known;
  std::vector<Viewpoint> viewpoints;  ///< that some are painted at, beside the capture's views
};

/// Place of the view that a name means: the capture's own name for it, else that of its file with or without extension.
/// @param entry        what errors begin with
/// @param other_names  one more a view, which mean it too
/// @throws UsageError  where no view is called so, or several are
[[nodiscard]] std::size_t view_called(const Capture& capture, const std::string& name, const std::string& entry,
                                      const std::vector<std::string>& other_names = {});

/// What `config.colorizer.keyframes`, `hint_images`, `hints` and `strokes` name, in the colours of `palette`; key
/// frames come first, since hints correct them; hints of one view are one source. Views are named as the capture names
/// them, or by their file's name with or without extension.
/// @throws UsageError         an entry that cannot be read, a view that is not there, or is held out.
/// @throws MissingInputError, InputError  a file that is not there, not a picture, of another shape, or without colour.
[[nodiscard]] GivenColors load_known_colors(const Capture& capture, const ColorizerOptions& config);

/// Makes the names of files in `config.keyframes`, `hint_images` and `strokes` absolute: a stored configuration is read
/// from any folder.  @throws UsageError.
void make_files_absolute(ColorizerOptions& config);

/// The files `config.keyframes` names.  @throws UsageError.
[[nodiscard]] std::vector<std::filesystem::path> key_frame_files(const ColorizerOptions& config);

/// The views that `config.keyframes` names, as the capture names them.  @throws UsageError.
[[nodiscard]] std::vector<std::string> key_frame_views(const Capture& capture, const ColorizerOptions& config);

}  // namespace cnerf::pipeline
