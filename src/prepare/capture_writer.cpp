#include "src/prepare/capture_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/capture/image_io.h"
#include "src/capture/pose.h"
#include "src/picture/contact_sheet.h"
#include "src/picture/encode.h"
#include "src/prepare/grey_image.h"

namespace cnerf::prepare {
namespace fs = std::filesystem;
namespace {

using Json = nlohmann::ordered_json;

Json lens_of(const View& view) {
  const Intrinsics& lens = view.intrinsics;
  Json out = {{"camera_model", lens.model == LensModel::kOpenCvFisheye ? "OPENCV_FISHEYE" : "OPENCV"},
              {"w", lens.width},
              {"h", lens.height},
              {"fl_x", lens.fx},
              {"fl_y", lens.fy},
              {"cx", lens.cx},
              {"cy", lens.cy}};
  const auto& k = lens.distortion;
  switch (lens.model) {
    case LensModel::kPinhole:
      break;
    case LensModel::kOpenCv:
      if (k[5] != 0 || k[6] != 0 || k[7] != 0) {
        throw InputError("lens of " + view.name + ": expected no rational denominator (k4, k5, k6 of FULL_OPENCV)");
      }
      out.update(Json{{"k1", k[0]}, {"k2", k[1]}, {"p1", k[2]}, {"p2", k[3]}, {"k3", k[4]}});
      break;
    case LensModel::kOpenCvFisheye:
      out.update(Json{{"k1", k[0]}, {"k2", k[1]}, {"k3", k[2]}, {"k4", k[3]}});
      break;
  }
  return out;
}

// ---- contact sheet ------------------------------------------------------------------------------------------------

constexpr int kThumbnail = 160, kColumns = 8, kGap = 4, kPlan = 480;
const cv::Scalar kBackground = cv::Scalar::all(kSheetBackground), kPointColor = cv::Scalar::all(130),
                 kTextColor = cv::Scalar::all(230), kBoxColor(255, 200, 60), kCameraColor(80, 180, 255);  // RGB

std::array<std::pair<Vec3d, Vec3d>, 12> edges_of(const Aabbd& box) {
  std::array<std::pair<Vec3d, Vec3d>, 12> edges;
  std::size_t n = 0;
  for (int axis = 0; axis < 3; ++axis) {
    for (int corner = 0; corner < 4; ++corner) {
      Vec3d from = box.min;
      from[(axis + 1) % 3] = (corner & 1) != 0 ? box.max[(axis + 1) % 3] : box.min[(axis + 1) % 3];
      from[(axis + 2) % 3] = (corner & 2) != 0 ? box.max[(axis + 2) % 3] : box.min[(axis + 2) % 3];
      Vec3d to = from;
      to[axis] = box.max[axis];
      edges[n++] = {from, to};
    }
  }
  return edges;
}

/// An edge is drawn in short pieces: lenses bend it, and parts may lie behind the camera.
void draw_box(cv::Mat& picture, const View& view, const Aabbd& box) {
  const Affined camera_from_world = view.world_from_camera.inverse();
  const double scale = double(picture.cols) / view.intrinsics.width;
  for (const auto& [from, to] : edges_of(box)) {
    std::optional<cv::Point> last;
    for (int piece = 0; piece <= 32; ++piece) {
      const Vec3d in_camera = camera_from_world.point(from + (to - from) * (piece / 32.0));
      const auto pixel = in_camera.z > 1e-9 ? project(view.intrinsics, in_camera) : std::nullopt;
      std::optional<cv::Point> here;
      if (pixel && std::abs(pixel->x) < 1e5 && std::abs(pixel->y) < 1e5) {
        here = cv::Point(int(std::lround(pixel->x * scale)), int(std::lround(pixel->y * scale)));
      }
      if (here && last) cv::line(picture, *last, *here, kBoxColor, 1, cv::LINE_AA);
      last = here;
    }
  }
}

Tile thumbnail(const fs::path& capture, const View& view, const std::optional<SubjectBox>& subject) {
  const LinearImage image = luminance_image(read_linear_image(capture / "images" / view.name, Transfer::kSrgb));
  cv::Mat picture;
  cv::cvtColor(reduced_to(grey_codes(image), kThumbnail), picture, cv::COLOR_GRAY2RGB);
  if (subject) draw_box(picture, view, subject->box);
  cv::putText(picture, view.name, {3, 11}, cv::FONT_HERSHEY_SIMPLEX, 0.3, kTextColor, 1, cv::LINE_AA);
  return {{picture.cols, picture.rows, {picture.data, picture.data + 3 * picture.total()}}, {}};
}

/// Cameras, points and box as two of the axes show them.
class Plan {
 public:
  Plan(int across, int up, const Aabbd& shown)
      : picture(kPlan, kPlan, CV_8UC3, kBackground), across_(across), up_(up), centre_(shown.centre()) {
    const Vec3d size = shown.size();
    scale_ = 0.92 * kPlan / std::max({size[across], size[up], 1e-12});
  }
  [[nodiscard]] cv::Point at(Vec3d p) const {
    return {int(std::lround(kPlan / 2.0 + (p[across_] - centre_[across_]) * scale_)),
            int(std::lround(kPlan / 2.0 - (p[up_] - centre_[up_]) * scale_))};
  }
  [[nodiscard]] double pixels(int count) const { return count / scale_; }
  void line(Vec3d a, Vec3d b, const cv::Scalar& color) { cv::line(picture, at(a), at(b), color, 1, cv::LINE_AA); }

  cv::Mat picture;

 private:
  int across_, up_;
  Vec3d centre_;
  double scale_;
};

cv::Mat drawn(Plan plan, const std::string& title, const std::vector<View>& views, const std::vector<Vec3d>& points,
              const std::optional<SubjectBox>& subject) {
  for (const Vec3d& point : points) cv::circle(plan.picture, plan.at(point), 0, kPointColor, cv::FILLED);
  for (const View& view : views) {
    const Vec3d eye = view.world_from_camera.translation;
    const double reach = plan.pixels(14);
    for (const double x : {0.0, double(view.intrinsics.width)}) {
      for (const double y : {0.0, double(view.intrinsics.height)}) {
        plan.line(eye, eye + (view.world_from_camera.linear * ray_direction(view.intrinsics, {x, y})) * reach,
                  kCameraColor);
      }
    }
    cv::circle(plan.picture, plan.at(eye), 2, kCameraColor, cv::FILLED, cv::LINE_AA);
  }
  if (subject) {
    for (const auto& [from, to] : edges_of(subject->box)) plan.line(from, to, kBoxColor);
  }
  cv::putText(plan.picture, title, {8, 18}, cv::FONT_HERSHEY_SIMPLEX, 0.5, kTextColor, 1, cv::LINE_AA);
  return plan.picture;
}

}  // namespace

Json transforms_json(const std::vector<View>& views, const std::vector<PreparedImage>& images,
                     const std::optional<SubjectBox>& subject, bool with_points) {
  std::map<std::string, const PreparedImage*> by_name;
  for (const PreparedImage& image : images) by_name[image.name] = &image;
  const bool one_lens =
      std::ranges::all_of(views, [&](const View& v) { return v.intrinsics == views.front().intrinsics; });
  Json out;
  if (one_lens) out.update(lens_of(views.front()));
  if (subject) {
    const Aabbd& box = subject->box;
    out["aabb"] = {{box.min.x, box.min.y, box.min.z}, {box.max.x, box.max.y, box.max.z}};
    if (subject->forward_facing) out["depth_range"] = {subject->near, subject->far};
  }
  if (with_points) out["sparse_points"] = kPointsFile;
  out["frames"] = Json::array();
  for (const View& view : views) {
    Json frame = {{"file_path", "images/" + view.name}};
    if (const auto found = by_name.find(view.name); found != by_name.end()) {
      const PreparedImage& image = *found->second;
      if (!image.mask.empty()) frame["mask_path"] = image.mask.generic_string();
      if (image.exposure != 1) frame["exposure"] = image.exposure;
      if (image.haze != 0) frame["haze"] = image.haze;
    }
    if (!one_lens) frame.update(lens_of(view));
    frame["transform_matrix"] = transforms_matrix(view.world_from_camera);
    out["frames"].push_back(std::move(frame));
  }
  return out;
}

std::string points_text(const std::vector<SparsePoint>& points) {
  std::string text = "# number, x y z, colour, error in pixels, then for each view that shows it its frame and a 0\n";
  std::size_t number = 0;
  for (const SparsePoint& point : points) {
    const Vec3d& at = point.position;
    text += fmt::format("{} {:.9g} {:.9g} {:.9g} 128 128 128 {:.4g}", ++number, at.x, at.y, at.z, point.error);
    for (const std::uint32_t view : point.views) text += fmt::format(" {} 0", view);
    text += '\n';
  }
  return text;
}

void write_contact_sheet(const fs::path& file, const fs::path& capture, const std::vector<View>& views,
                         const std::vector<Vec3d>& points, const std::optional<SubjectBox>& subject) {
  std::vector<Tile> thumbnails(views.size());
  parallel_tasks(views.size(), [&](std::size_t i) { thumbnails[i] = thumbnail(capture, views[i], subject); });
  Picture tiles = tiled(thumbnails, kColumns);
  const cv::Mat below(tiles.height, tiles.width, CV_8UC3, tiles.rgb.data());

  Aabbd shown = subject ? subject->box : Aabbd::empty();
  for (const View& view : views) shown.grow(view.world_from_camera.translation);
  const cv::Mat above = drawn({0, 1, shown}, "from above (x, y)", views, points, subject);
  const cv::Mat side = drawn({0, 2, shown}, "from the side (x, z)", views, points, subject);

  const int width = std::max(below.cols, 2 * kPlan + 3 * kGap);
  cv::Mat sheet(kPlan + kGap + below.rows, width, CV_8UC3, kBackground);
  above.copyTo(sheet({kGap, kGap, kPlan, kPlan}));
  side.copyTo(sheet({2 * kGap + kPlan, kGap, kPlan, kPlan}));
  below.copyTo(sheet({0, kPlan + kGap, below.cols, below.rows}));
  cv::cvtColor(sheet, sheet, cv::COLOR_RGB2BGR);
  write_png(file, sheet);
}

}  // namespace cnerf::prepare
