#pragma once
/// The training views in the GPU's memory.

#include <cstdint>
#include <vector>

#include "src/base/cuda/device_memory.h"
#include "src/engine/cuda/step_kernels.h"

namespace cnerf {

class ViewImages {
 public:
  ViewImages() = default;
  explicit ViewImages(const std::vector<TrainingView>& views);

  [[nodiscard]] ViewRecord* records() const { return records_.data(); }
  [[nodiscard]] std::uint32_t count() const { return std::uint32_t(records_.size()); }

 private:
  /// Where the pixels of an image lie, and how to read them.
  [[nodiscard]] ViewRecord record_of(const TrainingView& view);
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
};

}  // namespace cnerf
