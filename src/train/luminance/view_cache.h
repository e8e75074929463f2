#pragma once
/// View cache: what each training view sees of frozen geometry at a working resolution, and the few samples behind each
/// pixel.

#include <cstdint>
#include <functional>
#include <future>
#include <span>
#include <string>
#include <vector>

#include "src/capture/camera_record.h"
#include "src/cluster/ranks.h"
#include "src/engine/color_engines.h"
#include "src/engine/luminance_engine.h"
#include "src/render/training_views.h"
#include "src/train/luminance/seen_scene.h"

namespace cnerf {

/// A sample in 8 bytes: captures of millions of pixels have hundreds of millions of them.
struct CachedSample {
  float t = 0;                  ///< unit space
  std::uint16_t weight = 0;     ///< of 65535
  std::uint16_t luminance = 0;  ///< of 65535, times the view's `brightest`
};

/// One view at working resolution. Arrays are [H, W].
struct CachedView {
  UnitCamera camera;
  int width = 0, height = 0;
  std::vector<float> luminance;       ///< linear Y over the sky, or over black
  std::vector<float> opacity;         ///< of the field
  std::vector<std::uint8_t> ignored;  ///< where a mask says so; empty without one
  float brightest = 1;                ///< luminance of the brightest sample
  std::vector<CachedSample> samples;  ///< pixel by pixel, front to back
  std::vector<std::size_t> offsets;   ///< [H W + 1]

  [[nodiscard]] int short_side() const { return std::min(width, height); }
};

/// Renders a view with its short side at most `short_side` pixels. Of each pixel the heaviest samples are kept that
/// carry `share` of its weight.
/// @param report  is told the share that is done, some times a second; may throw
[[nodiscard]] CachedView cache_view(const SeenScene& scene, const UnitCamera& full_size_camera, int short_side,
                                    double share, const std::function<void(double fraction)>& report = {});

inline constexpr double kCachedWeight = 0.99;  ///< share of a pixel's weight that the samples of a ViewCache carry

/// The training views of a capture, and viewpoints after them. Who colours one stage 1 several times keeps it, so that
/// they are traced once.
class ViewCache {
 public:
  /// Ranks that trace the capture's views for each other: all of them call `fill` then.
  void trace_with(cluster::Ranks& ranks) { ranks_ = &ranks; }
  /// Traces the views, unless it holds them already at this size.
  /// @param short_side     pixels of their shorter side, at most
  /// @param report         is told the share that is done; may throw, and a later call goes on
  /// @throws UsageError    every view is held out.
  void fill(const SeenScene& scene, const Capture& capture, const SceneFrame& frame, int short_side,
            const std::function<void(double fraction)>& report);
  [[nodiscard]] std::span<const CachedView> views() const { return views_; }
  [[nodiscard]] std::span<const std::string> names() const { return names_; }  ///< as the capture has them
  [[nodiscard]] std::size_t of_capture() const { return names_.size() - viewpoints_.size(); }
  [[nodiscard]] std::span<const Viewpoint> viewpoints() const { return viewpoints_; }

  struct TracedViewpoint {
    Viewpoint viewpoint;
    CachedView view;
  };
  /// What is not held yet of these viewpoints, traced as the capture's views are: after `fill`.
  [[nodiscard]] std::vector<TracedViewpoint> traced(const SeenScene& scene, const SceneFrame& frame,
                                                    std::span<const Viewpoint> viewpoints,
                                                    const std::function<void(double fraction)>& report) const;
  [[nodiscard]] bool holds(const Viewpoint& viewpoint) const { return place_of(viewpoint) < names_.size(); }
  /// Holds them behind all others, which stay where they are: who goes through `views()` meanwhile is not disturbed.
  /// One of the same name and another camera loses its name. When there is no room for more, these are left out.
  void add(std::vector<TracedViewpoint>&& traced);
  /// Puts viewpoints that are held before the other ones, in their order. Views move.
  void put_first(std::span<const Viewpoint> viewpoints);
  /// Lets the viewpoints go that are none of these. Views move.
  void keep_only(std::span<const Viewpoint> viewpoints);

 private:
  void fill_alone(std::size_t count, const std::function<std::future<CachedView>(std::size_t)>& begin_view);
  [[nodiscard]] std::size_t place_of(const Viewpoint& viewpoint) const;

  cluster::Ranks* ranks_ = &cluster::alone();
  int short_side_ = 0;
  std::vector<CachedView> views_;   // with room for viewpoints, so that none moves as they come
  std::vector<std::string> names_;  // likewise
  std::vector<Viewpoint> viewpoints_;
};

/// Makes pixels transparent that the view's mask says to ignore, wholly or in part, and marks them: nothing there is
/// learnt from, and no histogram counts it. What a colorizer is shown stays.
void ignore_masked(CachedView& view, const MonoImage& image);

/// A pixel of one of several views.
struct ViewPixel {
  std::uint32_t view = 0;
  std::uint32_t pixel = 0;  ///< y * width + x
};
/// Samples of some pixels of cached views.
[[nodiscard]] PixelSamples pixel_samples(std::span<const CachedView> views, std::span<const ViewPixel> pixels);

}  // namespace cnerf
