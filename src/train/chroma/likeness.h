#pragma once
/// Colours everywhere: strokes whose colours run on without limit, so that each pixel has those of the strokes that it
/// is most like.

#include <array>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "src/train/chroma/known_colors.h"

namespace cnerf {

/// What pixels of a view look like, for telling how alike two of them are.  [H, W] each
struct PixelLooks {
  PixelLooks(const CachedView& view, std::span<const float> surface);

  std::vector<float> lightness;    ///< L*, mean of the pixels around
  std::vector<float> texture;      ///< L*, its standard deviation there
  std::span<const float> surface;  ///< `surface_distance`
};

/// Colours that may be a pixel's, the cheapest first.
struct Claims {
  static constexpr std::size_t kMost = 3;
  struct Claim {
    float cost = kUnreached;
    Ab color;
    float lightness = 100;  ///< L* where it was painted
  };
  std::array<Claim, kMost> list;

  /// Of a colour the least cost counts. Of equal costs what came first is first.
  void add(const Claim& claim);
  /// What part each has among those that are kept, 0..1.
  [[nodiscard]] std::array<float, kMost> shares() const;
  [[nodiscard]] float cost() const { return list[0].cost; }
  /// The first, and of others those that cost hardly more: a border between strokes is no edge where the scene has
  /// none. Darker than where it was painted a colour has less chroma. What was painted (cost 0) stays as it is.
  /// @param lightness  L* of the pixel
  [[nodiscard]] Ab mixed(float lightness) const;
};

/// Shares that colours have in a view's pixels are smoothed along surfaces and along what is equally light: a pixel is
/// judged together with those that it belongs to. What was painted stays as it is, and everything does where there are
/// too many colours, as of a painted picture.  @param claims  [H, W]
void smooth(std::span<Claims> claims, const CachedView& view, std::span<const float> surface);

/// Strokes of one view that everything is coloured by. They have at least one colour that runs, or nothing is claimed
/// but what they paint.
class StrokesEverywhere {
 public:
  /// Refers to the view and its surface.
  /// @param strokes  at the view's size
  StrokesEverywhere(const RunningColors& strokes, const CachedView& view, std::span<const float> surface);

  /// Of the pixels of the painted view; of those without a surface too.  [H, W]
  [[nodiscard]] std::span<const Claims> claims() const { return claims_; }
  /// What a pixel of any view may have by its looks and its place in space.
  /// @param ray  of the pixel
  void claim_alike(const Ray& ray, const PixelLooks& looks, std::size_t pixel, Claims& to) const;

 private:
  /// What pixels look like that a stroke paints, each in its place of the lists: as many of every colour, one colour
  /// after another. What is missing of a colour is like no pixel.
  struct Samples {
    std::vector<float> x, y, z;       ///< direction from the camera
    std::vector<float> log_distance;  ///< 0: there is no surface
    std::vector<float> lightness, texture;
  };
  struct Looked;
  void number_colors(std::span<const Ab> painted);
  void take_samples(const RunningColors& strokes, const PixelLooks& looks);
  void take_samples_of(std::span<const std::uint32_t> painted, std::span<const std::uint32_t> color_of,
                       std::span<const std::size_t> count, const PixelLooks& looks);
  [[nodiscard]] static float likeness(const Samples& samples, std::size_t begin, std::size_t end, const Looked& pixel,
                                      float per_angle);
  [[nodiscard]] std::uint32_t number_of(Ab color) const;

  const CachedView& view_;
  float cell_ = 0;  // side of the cells of ab whose colours count as one; 0: only equal ones do
  std::unordered_map<std::uint64_t, std::uint32_t> numbers_;  // of colours, by cell
  std::vector<Ab> colors_;
  std::vector<float> lightness_, reach_;  // [colours] L* where they were painted, mean; and how far they run, times
  Samples samples_;
  std::vector<std::size_t> sampled_;  // [colours] samples of it
  std::size_t room_ = 0;              // of each colour in the samples' lists
  std::vector<Claims> claims_;
};

}  // namespace cnerf
