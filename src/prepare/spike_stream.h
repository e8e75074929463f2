#pragma once
/// Streams of spike cameras: one bit per pixel and tick, 1 where the pixel had gathered a full measure of light (Huang
/// et al. 2022). A window of ticks becomes a picture.

#include <cstddef>
#include <filesystem>
#include <span>
#include <vector>

#include "src/base/options.h"
#include "src/base/progress.h"
#include "src/capture/image_io.h"
#include "src/prepare/photographs.h"

namespace cnerf::prepare {

struct SpikeOptions {
  int spike_width = 0, spike_height = 0;
  int spike_window = 64;  // ticks that are gathered to a picture
  bool spike_flip = false;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("spike_width", spike_width, Range{0, 100000},
      "pixels across of a spike stream (.dat), which does not say itself");
    v("spike_height", spike_height, Range{0, 100000}, "pixels down of a spike stream");
    v("spike_flip", spike_flip, "the stream's first row is the lowest");
  }
};

/// The picture of a window of ticks: the firing rate, 1 = a spike every tick. Where a pixel fired twice or more it is
/// the number of intervals over the ticks from its first spike to its last, which does not depend on where the window
/// cuts; else the count over the window.
/// @param ticks   [window][rows * columns / 8] bytes, lowest bit first, first row on top; each tick padded to bytes
/// @return  linear luminance in [0, 1].
[[nodiscard]] LinearImage integrate_spikes(std::span<const std::byte> ticks, int width, int height, int window);

/// Writes `count` pictures, evenly spread over the stream, to `capture/images` as 16-bit sRGB-encoded PNG.
/// @throws UsageError  sizes not given.  @throws InputError  a stream of another size, or shorter than two windows.
[[nodiscard]] PhotographSet import_spikes(const std::filesystem::path& stream, const std::filesystem::path& capture,
                                          const SpikeOptions& options, int count, const ProgressSink& progress);

}  // namespace cnerf::prepare
