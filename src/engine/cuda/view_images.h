#pragma once
/// The training views in the GPU's memory: all of them, or as many as may be there at once, in turns.

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "src/base/cuda/device_memory.h"
#include "src/engine/cuda/step_kernels.h"
#include "src/engine/cuda/view_rotation.h"

namespace cnerf {

class ViewImages {
 public:
  ViewImages() = default;
  /// @param memory  bytes that pixels may take; where they are more, `views` and their images are read later on
  ViewImages(const std::vector<TrainingView>& views, std::size_t memory);

  [[nodiscard]] ViewRecord* records() const { return records_.data(); }
  /// Those that pixels are drawn from; see DrawJob.
  [[nodiscard]] std::uint32_t count() const { return rotation_ ? rotation_->count() : std::uint32_t(records_.size()); }
  [[nodiscard]] const std::uint32_t* resident() const { return rotation_ ? rotation_->resident() : nullptr; }
  /// To be called before each step: its views are there then, by the order of the stream.
  void follow(long step, cudaStream_t stream) const {
    if (rotation_) rotation_->follow(step, stream);
  }

 private:
  /// Where the pixels of an image lie, and how to read them.
  [[nodiscard]] ViewRecord record_of(const TrainingView& view, bool with_pixels);
  [[nodiscard]] const std::uint8_t* plane(const void* data, std::size_t bytes);
  /// Linear luminance of every integer value of an image.
  [[nodiscard]] const float* decoded(const MonoImage& image);

  [[nodiscard]] DirectionView sky(const DirectionMap& map);

  std::vector<DeviceBuffer<std::uint8_t>> planes_;
  std::vector<DeviceBuffer<float>> tables_;
  const DirectionMap* uploaded_sky_ = nullptr;  // all views see the same
  DirectionView sky_;
  const float* shared_tables_[2][3] = {};  // per kind of integer and transfer, of images without exposure of their own
  DeviceBuffer<ViewRecord> records_;
  std::unique_ptr<ViewRotation> rotation_;  // where they do not all fit
};

}  // namespace cnerf
