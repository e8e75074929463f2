#pragma once
/// The engine of stage 1, one implementation per device: march, hash grid, nets, compositing, loss, gradients, Adam,
/// occupancy.

#include <algorithm>
#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "encoding/hash_grid_levels.h"
#include "src/engine/pixel_samples.h"
#include "src/engine/stage1_schedule.h"
#include "src/engine/step_share.h"
#include "src/engine/view_learning.h"
#include "src/field/state.h"
#include "src/render/march.h"
#include "src/render/observed_ray.h"
#include "src/render/occupancy_grid.h"
#include "src/render/training_views.h"

namespace cnerf {

struct LuminanceEngineOptions {
  HashGridOptions grid;
  OccupancyOptions occupancy;
  int cascades = 1;
  MarchSettings march;
  int samples_per_step = 1 << 16;  ///< trained samples that a step aims at
  float max_luminance = 1.0f;      ///< of the images; the field emits at most a little more
  float distortion_weight = 0;     ///< of each ray's distortion (distortion_math.h) in the loss
  DepthLearning depth;             ///< of views that know of depths
  ViewLearning learning;
  std::uint64_t seed = 1;
};

/// What a step did.
struct StepReport {
  double loss = 0;           ///< mean over rays of ((L* - L*_observed) / 100)^2 + distortion_weight * distortion
  double squared_error = 0;  ///< mean over rays, on sRGB-encoded luminance clamped to [0, 1]
  std::size_t rays = 0;
  std::size_t trained_samples = 0;
};

/// What may be left out of a picture for speed.
struct RenderEffort {
  /// A ray ends below this, and counts as opaque: what is left of it is taken to look like what was seen.
  float min_transmittance = 1e-3f;
  /// Of a ray's weight: only the heaviest samples that carry this much are shaded, and their weights are scaled up to
  /// the ray's whole opacity. Most samples of a ray weigh next to nothing; 1 shades them all.
  float shaded_share = 1;

  /// Of a ray whose samples weigh `total`.
  [[nodiscard]] float opacity_of(float total) const { return total > 1 - min_transmittance ? 1 : total; }
};

/// Bytes of a device's memory for the views' pixels: what is allowed, but not all that is free, since pictures and
/// samples need some of it later.
[[nodiscard]] inline std::size_t image_memory_on_device(std::size_t allowed, std::size_t free) {
  return std::min(allowed, free - free / 8);
}

class LuminanceEngine {
 public:
  virtual ~LuminanceEngine() = default;

  /// Bytes of the device's memory that the views' pixels may take at most, where it is not the host's. What does not
  /// fit, in them or in what the device has free, comes and goes between steps, which draw from what is there. To be
  /// called before `set_views`.
  virtual void limit_image_memory(std::size_t /*bytes*/) {}
  /// What steps draw their pixels from. To be called before the first step; the images must outlive the steps.
  virtual void set_views(const std::vector<TrainingView>& views) = 0;
  /// Steps work on a share of their pixels from now on; their reports are of the whole.
  /// @throws DeviceError  an engine that cannot
  virtual void share_steps(const StepShare& share);
  /// To be called by all processes that share steps before one asks for `state` or stops sharing them: each may have
  /// updated a piece of the parameters only.
  virtual void complete_state() {}
  /// One optimiser step. The same step number draws the same pixels.
  virtual StepReport step(float learning_rate) = 0;
  [[nodiscard]] virtual long step_count() const = 0;
  /// What was learned of the views, in their order. Empty where nothing is.
  [[nodiscard]] virtual std::vector<ViewCorrection> view_corrections() const { return {}; }
  /// And of the lenses that they share (TrainingView::lens).
  [[nodiscard]] virtual std::vector<LensCorrection> lens_corrections() const { return {}; }

  /// @param march  may step otherwise than training did
  virtual void render(std::span<const Ray> rays, const MarchSettings& march, const RenderEffort& effort,
                      std::span<RayResult> results) const = 0;
  /// `render` for every pixel of a camera, row by row.
  virtual void render_view(const UnitCamera& camera, const MarchSettings& march, const RenderEffort& effort,
                           std::span<RayResult> results) const;
  /// The samples behind `render`'s results, ray by ray in order; `offsets` has rays + 1 entries.
  virtual void trace(std::span<const Ray> rays, const MarchSettings& march, const RenderEffort& effort,
                     std::vector<WeightedSample>& samples, std::vector<std::size_t>& offsets) const = 0;
  /// `trace` for somebody who colours the pixels with a colour engine of the same device: nothing but results leaves
  /// it. Its samples take memory, so not many more than `rays_at_a_time` should be asked for.
  [[nodiscard]] virtual std::unique_ptr<TracedPixels> trace_pixels(std::span<const Ray> rays,
                                                                   const MarchSettings& march,
                                                                   const RenderEffort& effort) const;
  [[nodiscard]] virtual std::size_t rays_at_a_time() const { return std::size_t(1) << 13; }

  /// Points worth asking for at once, by one of many threads.
  [[nodiscard]] virtual std::size_t points_at_a_time() const { return std::size_t(1) << 12; }
  virtual void query_density(std::span<const Vec3f> positions, std::span<float> sigma) const = 0;
  virtual void query_luminance(std::span<const Vec3f> positions, std::span<const Vec3f> directions,
                               std::span<float> luminance) const = 0;
  [[nodiscard]] virtual const OccupancyGrid& occupancy() const = 0;
  /// See OccupancyGrid::exclude. To be called before the first step.
  virtual void exclude(const std::function<bool(Vec3f centre, float radius)>& wanted) = 0;

  /// Everything that continues a run bit for bit. After writing into the pieces, call `state_loaded`.
  [[nodiscard]] virtual std::vector<StatePiece> state() = 0;
  virtual void state_loaded() = 0;
};

[[nodiscard]] std::unique_ptr<LuminanceEngine> make_cpu_luminance_engine(const LuminanceEngineOptions& options);
/// Steps run behind the caller's back: a report may be of a step shortly before.
/// @throws DeviceError  without a usable GPU, or when its memory does not suffice
[[nodiscard]] std::unique_ptr<LuminanceEngine> make_cuda_luminance_engine(const LuminanceEngineOptions& options);
/// Whether there is a GPU that can be used; false in builds without CNERF_CUDA.
[[nodiscard]] bool has_cuda_device();
/// Its name and memory.
[[nodiscard]] std::string cuda_device_text();

}  // namespace cnerf
