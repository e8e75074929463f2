#pragma once
/// Training views that take turns in the GPU's memory. Steps draw pixels from those that are there; every few steps the
/// one that was there longest goes, and another takes its place. Copying goes on beside the steps.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <future>
#include <vector>

#include "src/base/cuda/device_memory.h"
#include "src/base/cuda/stream.h"
#include "src/engine/cuda/step_kernels.h"

namespace cnerf {

/// Of the pixels and all that is known of them.
[[nodiscard]] std::size_t pixel_bytes(const TrainingView& view);
/// Where a plane lies on the GPU; null for an empty one.
using PlacePlane = std::function<const std::uint8_t*(const void* data, std::size_t bytes)>;
/// Places the planes of a view.
void place_pixels(const TrainingView& view, const PlacePlane& place, PlacedView& placed);

class ViewRotation {
 public:
  /// @param views    are copied; their images must outlive this
  /// @param memory   bytes, for three views at least
  /// @param records  of all views, in device memory; their pixels are set here
  /// @throws DeviceError  the memory is too little
  ViewRotation(std::vector<TrainingView> views, std::size_t memory, ViewRecord* records);
  ~ViewRotation();
  ViewRotation(const ViewRotation&) = delete;
  ViewRotation& operator=(const ViewRotation&) = delete;

  /// Numbers of the views that a step draws from, in the order of `resident`.
  /// @param views  of all;  @param resident  at a time
  [[nodiscard]] static std::vector<std::size_t> views_of_step(long step, std::size_t views, long resident);

  [[nodiscard]] std::uint32_t count() const { return std::uint32_t(resident_.size()); }
  /// [count()], device memory.
  [[nodiscard]] const std::uint32_t* resident() const { return resident_.data(); }
  /// Which views are there depends on the step alone, so that a training goes on as it would have.
  void follow(long step, cudaStream_t stream);

 private:
  [[nodiscard]] std::size_t view_at(long turn) const;
  void start_copy(long turn);
  void finish_copy(long turn, cudaStream_t stream);

  std::vector<TrainingView> views_;
  std::vector<std::size_t> order_;  // of their turns
  ViewRecord* records_;
  std::size_t slot_bytes_;
  long slots_;
  DeviceBuffer<std::uint8_t> memory_;  // one slot more than there are views: the next one is copied to it
  DeviceBuffer<std::uint32_t> resident_;
  std::uint8_t* staging_ = nullptr;  // pinned
  CudaStream copies_;
  CudaEvent copied_, free_;
  std::future<PlacedView> copying_;
  long next_ = -1;  // the turn whose view comes next; -1: none is there yet
};

}  // namespace cnerf
