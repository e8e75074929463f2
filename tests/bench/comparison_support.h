#pragma once
/// What the benchmarks that compare pictures share: the whole program but for the picture of a bake, and the measure.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "bake/color/view_average.h"
#include "export/manifest.h"
#include "export/web_pictures.h"
#include "src/capture/capture.h"
#include "src/color/colorspace_math.h"
#include "src/picture/encode.h"
#include "src/train/scene.h"

namespace cnerf::bench {

/// sRGB of linear light, clamped to what can be shown.
inline double encoded(float linear) {
  return srgb_from_linear(std::clamp(linear, 0.0f, 1.0f));
}

/// Of the mean of `values` squared differences; at most 120.
inline double decibels(double squared, std::size_t values) {
  return -10 * std::log10(std::max(squared / double(std::max<std::size_t>(values, 1)), 1e-12));
}

/// How like the field's render a picture is, pixel by pixel: squared differences of sRGB-encoded colour over black, and
/// how far their silhouettes (opacity above a half) overlap.
class Likeness {
 public:
  /// @param rgba  linear, premultiplied.  @param wanted  linear RGB.  @param opacity  of the wanted.
  void add(const float* rgba, const float* wanted, float opacity);
  /// The pixels of another picture.
  void add(const Likeness& other);

  /// The whole picture, black where nothing is.
  [[nodiscard]] double picture() const { return decibels(squared_, 3 * pixels_); }
  /// Pixels that either covers to more than 1 %.
  [[nodiscard]] double covered() const { return decibels(squared_covered_, 3 * covered_); }
  /// Pixels that both cover to 99 %: without rims and thin parts.
  [[nodiscard]] double inside() const { return decibels(squared_inside_, 3 * inside_); }
  /// Intersection over union of the silhouettes.
  [[nodiscard]] double overlap() const { return double(both_) / double(std::max<std::size_t>(either_, 1)); }
  /// All of it in words.
  [[nodiscard]] std::string text() const;

 private:
  double squared_ = 0, squared_covered_ = 0, squared_inside_ = 0;
  std::size_t pixels_ = 0, covered_ = 0, inside_ = 0, both_ = 0, either_ = 0;
};

/// @param rgba  [H, W, 4] of the view that `field` was rendered from, see Likeness::add.
[[nodiscard]] Likeness likeness_of(std::span<const float> rgba, const RenderedImage& field);
/// What every comparison has: a bake, the capture behind it, and the field, as snapshots or as a folder of its
/// pictures.
struct Comparison {
  std::filesystem::path bake, renders;  ///< folders; renders: empty where there are snapshots
  std::map<std::string, int> options;
  exporting::BakeManifest manifest;
  Capture capture;
  std::unique_ptr<Scene> scene;                ///< null without snapshots
  std::unique_ptr<bake::ViewAverage> average;  ///< of the scene with averaged=1, else null

  [[nodiscard]] bool has_field() const { return scene != nullptr || !renders.empty(); }
  /// The field's picture of a view: colours of samples, and luminance as it is or averaged.
  /// @throws MissingInputError, InputError  where it is to be read.
  [[nodiscard]] RenderedImage field_of(const View& view) const;
};

/// The program `name`_comparison: reads `BAKE CAPTURE [STAGE1.snapshot [TAKE.snapshot] | RENDERS] key=value...` and
/// calls `each` for the views to compare, with the field's picture of them (null where there is no field), which are
/// the first held-out ones (of all where none is), with trained=1 some of the others, evenly spread. RENDERS is a
/// folder with the field's pictures instead of snapshots, as `cnerf render RUN
/// --view-averaged --path held-out --format exr` leaves them: made on a GPU, say. Of the pictures that `each` returns,
/// [H, W, 4] or nothing, pictures=1 writes BAKE/`name`_comparison.png: picture, field, and what the picture adds to the
/// field's sRGB-encoded colour, at twice the contrast; grey where it adds nothing.
/// @param options  of this comparison; all have views=3, downscale=1, holdout=0, trained=0, averaged=0, pinhole=0 and
/// pictures=0;
///                 pinhole=1 takes the distortion of lenses away.
/// @return  the program's exit status.
int compare_views(int argc, char** argv, const std::string& name, std::map<std::string, int> options,
                  const std::function<std::vector<float>(Comparison&, const View&, const RenderedImage*)>& each);

/// `FILE... key=value...` behind the program's name.
struct Arguments {
  std::vector<std::string> files;
  std::map<std::string, int> options;
};
/// @param options  the known ones with their defaults.  @throws std::out_of_range, std::invalid_argument  on others.
[[nodiscard]] Arguments parse_arguments(int argc, char** argv, std::map<std::string, int> options);

}  // namespace cnerf::bench
