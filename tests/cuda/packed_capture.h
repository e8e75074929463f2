#pragma once
/// A capture ready to be trained on, as plain files: what a machine with a GPU but without image codecs can read.
/// `scene.bin` holds cameras, placement, excluded space and sparse points; pixels lie beside it, one raw 8-bit file a
/// view
/// (`0001.grey`, and `0001.alpha` where there is alpha).

#include <filesystem>
#include <vector>

#include "src/capture/capture.h"
#include "src/field/scene_frame.h"

namespace cnerf::test {

struct PackedCapture {
  Capture capture;
  SceneFrame frame;
  int occupancy_resolution = 128;
  std::vector<std::uint8_t> excluded;  ///< [cells of the occupancy grid], 1 = empty for good
  std::vector<Affined> truth;          ///< of the training views, before cameras were disturbed or adjusted
};

void write_packed(const PackedCapture& packed, const std::filesystem::path& folder);
[[nodiscard]] PackedCapture read_packed(const std::filesystem::path& folder);

}  // namespace cnerf::test
