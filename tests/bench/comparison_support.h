#pragma once
/// What the benchmarks that compare pictures share: their command lines, the views and renders they compare with, and
/// their measure.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "bake/color/view_average.h"
#include "export/manifest.h"
#include "src/capture/capture.h"
#include "src/color/colorspace_math.h"
#include "src/picture/contact_sheet.h"
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

/// The field over black, linear RGB; grey where it has no colour.  [H, W, 3]
[[nodiscard]] std::vector<float> rgb_of(const RenderedImage& image);

/// How to render a field for comparisons with a bake: colours of samples, and luminance as it is or averaged.
/// @param average  null, or what `render` is to show; must outlive the result.
[[nodiscard]] RenderOptions field_options(const Scene& scene, const bake::ViewAverage* average);

/// The view-averaged field behind a bake, on lattices like its own.
[[nodiscard]] std::unique_ptr<bake::ViewAverage> average_behind(const exporting::BakeManifest& bake, const Scene& scene,
                                                                const Capture& capture);

/// A view of the field as `cnerf render --path held-out --format exr` leaves it in a folder.
/// @throws MissingInputError, InputError.
[[nodiscard]] RenderedImage read_render(const std::filesystem::path& folder, const View& view);

/// The first held-out views (of all views where none is), or trained ones, evenly spread; at most `most`.
[[nodiscard]] std::vector<const View*> views_to_compare(const Capture& capture, bool trained, int most);

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
/// A row of three pictures: this one, the field, and what this one adds to the field's sRGB-encoded colour, at twice
/// the contrast; grey where it adds nothing.
void add_row(ContactSheet& sheet, std::span<const float> rgba, const RenderedImage& field);

/// `FILE... key=value...` behind the program's name.
struct Arguments {
  std::vector<std::string> files;
  std::map<std::string, int> options;
};
/// @param options  the known ones with their defaults.  @throws std::out_of_range, std::invalid_argument  on others.
[[nodiscard]] Arguments parse_arguments(int argc, char** argv, std::map<std::string, int> options);

}  // namespace cnerf::bench
