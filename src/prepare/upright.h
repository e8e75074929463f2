#pragma once
/// The frame of a prepared capture: Z-up, with a unit and the subject near the origin. One similarity leads there from
/// COLMAP's frame, which has none of these.

#include <optional>
#include <string>
#include <vector>

#include "src/base/aabb.h"
#include "src/base/options.h"
#include "src/capture/arrangement.h"
#include "src/prepare/similarity.h"

namespace cnerf::prepare {

struct FrameOptions {
  std::string up = "auto";
  double scale = 0;  // capture units per unit of the poses; 0 = cameras are 1 from the subject
  std::string measure;
  std::string box;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("up", up, "which way is up: auto, cameras, none, or x,y,z in the frame of the poses");
    v("measure", measure,
      "a known length, 'x1,y1,view1 x2,y2,view2 = 1.2m' in pixels of the prepared images; the scene is then in metres");
    v("box", box, "the subject's box, 'x,y,z x,y,z' in units of the capture, instead of the one that is found");
  }
};

/// Whether the texts of the options can be read, which is known before there are poses.
/// @throws UsageError  naming the option
void check_texts(const FrameOptions& options);

/// What the frame was chosen by, for prepare.json and the user.
struct FrameChoice {
  Similarity capture_from_poses;
  std::string up_by;        ///< "ground", "level cameras", "camera tops", "given", "none"
  double ground_share = 0;  ///< of the points near the subject that lie on the ground plane, where there is one
  bool metres = false;      ///< the unit is known
};

/// Up for a photographer who holds the camera level: the direction all cameras' horizontal axes are square to, where
/// these point in enough directions to tell; else the mean of the pictures' own tops.
struct UpFromCameras {
  Vec3d up;                ///< unit length
  bool from_axes = false;  ///< by the horizontal axes
};
[[nodiscard]] UpFromCameras up_from_cameras(const std::vector<Affined>& world_from_camera);

/// The largest plane of points that could be a floor or a table: within 30 degrees of level, hardly anything below it.
struct GroundPlane {
  Vec3d normal;       ///< unit length, up
  double height = 0;  ///< normal . x of its points
  double share = 0;   ///< of the points that lie on it
};
[[nodiscard]] std::optional<GroundPlane> find_ground(const std::vector<Vec3d>& points, Vec3d roughly_up);

/// The point nearest to rays, and how far they pass from it.
struct Triangulated {
  Vec3d point;
  double distance = 0;        ///< root mean square, units of the rays
  double widest_degrees = 0;  ///< between two of the rays: below about 1 the depth is a guess
};
/// @param rays  at least two, not all parallel.  @throws InputError.
[[nodiscard]] Triangulated triangulate(const std::vector<WorldRay>& rays);

/// Length between the two ends of a measure, in units of the poses, over its length in metres. An end seen in several
/// views ("x,y,view+x,y,view") is triangulated; an end seen in one lies at the depth of the points around it.
/// @throws UsageError  a text that is no measure, an unknown view.  @throws InputError  an end without depth.
[[nodiscard]] double units_per_metre(const std::string& measure, const std::vector<View>& views,
                                     const std::vector<Vec3d>& points);

/// Chooses the frame. The subject, what the cameras look at, comes near the origin; the ground, if there is one, to
/// z=0.
/// @throws UsageError, InputError  as `units_per_metre`, and an `up` that is none.
[[nodiscard]] FrameChoice choose_frame(const std::vector<View>& views, const std::vector<Vec3d>& points,
                                       const FrameOptions& options);

/// A box given as two of its corners, "x,y,z x,y,z", in any order.  @throws UsageError  another text, or a flat box.
[[nodiscard]] Aabbd parse_box(const std::string& text);

/// The subject's box, in the frame of views and points: between the cameras where they look inwards, what they see up
/// to a far plane where they look one way. Nothing when there are too few points.
struct SubjectBox {
  Aabbd box;
  bool forward_facing = false;
  double near = 0, far = 0;  ///< along the optical axes, of 99.8 % of the points in view
};
[[nodiscard]] std::optional<SubjectBox> find_subject(const std::vector<View>& views, const std::vector<Vec3d>& points);

}  // namespace cnerf::prepare
