#pragma once
/// Rendering, tracing and querying stage 1's field on the GPU.

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "src/base/cuda/stream.h"
#include "src/engine/cuda/trace_kernel.h"
#include "src/engine/cuda/traced_pixels.h"
#include "src/engine/luminance_engine.h"

namespace cnerf {

/// Memory is taken when it is first needed. Calls are made one at a time.
class LuminanceTracerCuda {
 public:
  static constexpr std::uint32_t kPointsAtATime = 1 << 20;
  static constexpr std::size_t kTracedAtATime = 1 << 17;  ///< rays whose samples are kept

  /// @param layout, occupied  the occupancy grid and its bits
  LuminanceTracerCuda(const OccupancyLayout& layout, const std::uint32_t* occupied, cudaStream_t stream)
      : layout_(layout), occupied_(occupied), stream_(stream) {}

  // See LuminanceEngine.
  void render(const FieldView& field, std::span<const Ray> rays, const MarchSettings& march, const RenderEffort& effort,
              std::span<RayResult> results);
  void render_view(const FieldView& field, const UnitCamera& camera, const MarchSettings& march,
                   const RenderEffort& effort, std::span<RayResult> results);
  void trace(const FieldView& field, std::span<const Ray> rays, const MarchSettings& march, const RenderEffort& effort,
             std::vector<WeightedSample>& samples, std::vector<std::size_t>& offsets);
  [[nodiscard]] std::unique_ptr<TracedPixels> trace_pixels(const FieldView& field, std::span<const Ray> rays,
                                                           const MarchSettings& march, const RenderEffort& effort);
  /// Density at points, or the luminance seen along directions.
  /// @param directions  empty: density
  void query(const FieldView& field, std::span<const Vec3f> positions, std::span<const Vec3f> directions,
             std::span<float> answers);

 private:
  void wait() const { CNERF_CUDA(cudaStreamSynchronize(stream_)); }
  /// Makes room for rays, and a job that follows them; what it answers with is still to be set.
  [[nodiscard]] TraceJob job(const FieldView& field, std::uint32_t rays, const MarchSettings& march,
                             const RenderEffort& effort);
  [[nodiscard]] TraceJob job_of_rays(const FieldView& field, std::span<const Ray> rays, const MarchSettings& march,
                                     const RenderEffort& effort);

  void trace_to(const FieldView& field, std::span<const Ray> rays, const MarchSettings& march,
                const RenderEffort& effort, TracedBuffers& to);

  OccupancyLayout layout_;
  const std::uint32_t* occupied_;
  cudaStream_t stream_;

  DeviceBuffer<StepState> state_;
  DeviceBuffer<Ray> plain_rays_;
  DeviceBuffer<RayRecord> rays_;
  DeviceBuffer<DirectionCode> directions_;
  DeviceBuffer<RayResult> results_;
  DeviceBuffer<WeightedSample> scratch_;
  TracedBuffers to_host_;
  std::shared_ptr<TracedBuffers> kept_;  // of the pixels that were traced last
  DeviceBuffer<Vec3f> points_, point_directions_;
  DeviceBuffer<float> answers_;
};

}  // namespace cnerf
