#pragma once
/// Strokes: what somebody painted on views, as a list that can be hidden, recoloured and made again. A stroke changes
/// colour, never light.

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "src/base/json_record.h"
#include "src/base/record.h"
#include "src/capture/camera_record.h"
#include "src/capture/capture.h"
#include "src/capture/image_io.h"
#include "src/train/chroma/known_colors.h"

namespace cnerf {

inline constexpr std::size_t kMostStrokes = 2000;
inline constexpr std::size_t kMostStrokePoints = 20000;  ///< of one stroke
inline constexpr std::size_t kLargestStrokeFile = std::size_t(16) << 20;
inline constexpr int kLargestViewpoint = 2048;  ///< pixels a side

/// A place of a stroke: x and y as shares of the picture's width and height, pressure 0..1.
using StrokePoint = std::array<float, 3>;

/// What a picture of a paint program paints: colours where it is not transparent.  [H, W]
struct PaintedPicture {
  int width = 0, height = 0;
  std::vector<Ab> ab;
  std::vector<std::uint8_t> is_known;  ///< 0 or 1
};

struct Stroke {
  std::string id;    ///< letters and digits, its own
  std::string view;  ///< a training view, as the capture names it, or a viewpoint
  /// "paint": the colour runs over what is alike around it; "exact": it stays where it was painted; "grey": paint
  /// without colour; "erase": takes away what was painted before it on the view; "picture": what `picture` paints.
  std::string kind = "paint";
  std::string color = "#808080";  ///< sRGB; only hue and chroma count
  float size = 0.02f;             ///< diameter at full pressure, as a share of the picture's shorter side
  float softness = 0;             ///< share of the radius over which it fades out
  float reach = 1;                ///< how far the colour runs, times StrokeReach
  bool hidden = false;
  std::vector<StrokePoint> points = {};  ///< joined by straight lines; one is a dot
  std::string picture = {};              ///< 12 hexadecimal digits: a file of the folder `painted` beside the list
  std::shared_ptr<const PaintedPicture> painted = {};  ///< what that file holds
  std::string word = {};  ///< what is painted, such as "jacket": a palette's colour of that word replaces `color`

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("id", self.id);
    v("view", self.view);
    v("kind", self.kind);
    v("color", self.color, kOptional);
    v("word", self.word, kOptional);
    v("size", self.size);
    v("softness", self.softness, kOptional);
    v("reach", self.reach, kOptional);
    v("hidden", self.hidden, kOptional);
    v("points", self.points, kOptional);
    v("picture", self.picture, kOptional);
  }
};

/// The painted pictures of a folder of strokes, each read once. Thread-safe.
class PaintedPictures {
 public:
  /// @param folder  that a stroke file lies in
  explicit PaintedPictures(std::filesystem::path folder) : folder_(std::move(folder)) {}

  [[nodiscard]] std::filesystem::path file(const std::string& picture) const {
    return folder_ / "painted" / (picture + ".png");
  }
  /// @throws MissingInputError, InputError  of the file
  [[nodiscard]] std::shared_ptr<const PaintedPicture> find(const std::string& picture);

 private:
  std::filesystem::path folder_;
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<const PaintedPicture>> read_;
};

/// Of a picture as paint programs write them, transparent except for paint.
/// @param name  that errors have
/// @throws InputError  it is opaque, or nothing is painted on it
[[nodiscard]] PaintedPicture painted_picture(const LinearImage& image, const std::filesystem::path& name);

/// Content of a stroke file.
struct StrokeList {
  int revision = 0;  ///< grows with every change
  std::vector<Stroke> strokes;
  /// Cameras that were painted through beside the capture's. Their names are letters, digits and "-", and no view's.
  std::vector<Viewpoint> viewpoints = {};
  /// Strokes colour all that there is, each what is most like it; otherwise what lies within their reach.
  bool everywhere = false;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("revision", self.revision, kLater);
    v("strokes", self.strokes);
    v("viewpoints", self.viewpoints, kLater);
    v("everywhere", self.everywhere, kOptional);
  }
};

/// Names of a capture's views.
struct PaintableViews {
  std::vector<std::string> names;
  std::vector<std::string> held_out = {};  ///< no stroke may name them, and no viewpoint be called like them
};

/// Strokes out of JSON of any content.
/// @param file      that errors name
/// @param views     that strokes may name
/// @param pictures  that strokes may name
/// @throws InputError  "file: strokes[3].size: …": no such list, a number out of range, an unknown view or kind; of a
///                     viewpoint "file: viewpoints[2].lens.fx: …"
[[nodiscard]] StrokeList strokes_of_json(std::string_view text, const std::filesystem::path& file,
                                         const PaintableViews& views, PaintedPictures& pictures);
/// @throws MissingInputError, and as strokes_of_json
[[nodiscard]] StrokeList read_strokes(const std::filesystem::path& file, const PaintableViews& views);
/// @throws OutputError
void write_strokes(const std::filesystem::path& file, const StrokeList& list);

/// sRGB "#c08040" -> its a and b; nothing where the text is no colour.
[[nodiscard]] std::optional<Ab> ab_of_hex(const std::string& color);

/// The views that can be painted are those that are not held out.
[[nodiscard]] PaintableViews paintable_views(const Capture& capture);
/// The viewpoints that strokes name, in the list's order.
[[nodiscard]] std::vector<Viewpoint> painted_viewpoints(const StrokeList& list);

/// Where a stroke covers a picture: 0 none, 1 whole.  [H, W]
/// @param coverage  larger values that are there already stay
void cover(const Stroke& stroke, int width, int height, std::span<float> coverage);

/// What is painted on each view that has anything visible, at the views' sizes.
/// @param lenses  [names] of their pictures
[[nodiscard]] std::vector<KnownColors> painted(const StrokeList& list, std::span<const std::string> names,
                                               std::span<const Intrinsics> lenses);

/// The paint of one view.  @return  nothing is known where nothing is painted
[[nodiscard]] KnownColors painted_on(const std::string& view, std::span<const Stroke> strokes, int width, int height);

}  // namespace cnerf
