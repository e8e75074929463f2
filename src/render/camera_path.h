#pragma once
/// Cameras to render from: on a spiral, on an orbit, at the held-out views, or from a file.

#include <filesystem>
#include <string>
#include <vector>

#include "src/capture/capture.h"
#include "src/render/picture_options.h"

namespace cnerf {

struct PathCamera {
  std::string name;  ///< of the picture, without extension
  Intrinsics intrinsics;
  Affined world_from_camera;  ///< OpenCV axes
};

struct CameraPath {
  std::string name;  ///< "spiral", "orbit", "held-out", stem of a file
  std::vector<PathCamera> cameras;
};

/// The frames of a path that have the same camera, in the order of their first ones: what goes to and fro sees nearly
/// all of it twice.
[[nodiscard]] std::vector<std::vector<std::size_t>> frames_of_equal_cameras(const CameraPath& path);

/// Whether a picture is called as the numbered ones of a path are: "frame_0012".
[[nodiscard]] bool is_frame_name(const std::string& name);

/// A closed ellipse in the plane of the cameras, looking at the focus (Mildenhall et al. 2019).
[[nodiscard]] CameraPath spiral_path(const Capture& capture, const PictureOptions& config);
/// A circle about the focus at the cameras' median distance and height. Where the cameras leave more than a third of
/// the circle unseen, the path swings to and fro over the part they cover, by the same cameras.
[[nodiscard]] CameraPath orbit_path(const Capture& capture, const PictureOptions& config);
/// Spiral or orbit, whichever suits the capture.
[[nodiscard]] CameraPath turntable_path(const Capture& capture, const PictureOptions& config);
/// @throws InputError  when the capture holds nothing out.
[[nodiscard]] CameraPath held_out_path(const Capture& capture);
/// A file in the manner of transforms.json: frames[].transform_matrix (OpenGL camera axes), w, h and fl_x or
/// camera_angle_x, in the file or in a frame.  @throws MissingInputError, InputError naming file and field.
[[nodiscard]] CameraPath path_from_file(const std::filesystem::path& file);

/// `spiral`, `orbit`, `turntable`, `held-out` or a file.
[[nodiscard]] CameraPath make_path(const std::string& kind, const Capture& capture, const PictureOptions& config);

/// Camera at `position` that looks at `target`, with `up` pointing up in the picture.
[[nodiscard]] Affined look_at(Vec3d position, Vec3d target, Vec3d up);

}  // namespace cnerf
