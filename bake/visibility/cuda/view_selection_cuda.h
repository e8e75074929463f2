#pragma once
/// ViewSelection for many points at once on the GPU, which gets a copy of all levels.

#include <memory>

#include "bake/visibility/view_selection.h"

namespace cnerf::bake {

class ViewSelectionCuda final : public ViewSelection {
 public:
  /// @throws DeviceError  when the GPU's memory does not suffice
  ViewSelectionCuda(const std::vector<Camera>& cameras, std::vector<DensityLevel> levels, const Options& options);
  ~ViewSelectionCuda() override;

  void find(std::size_t level, const SightBatch& batch, SeenBatch& answer) const override;

 private:
  struct Memory;
  std::unique_ptr<Memory> memory_;
};

}  // namespace cnerf::bake
