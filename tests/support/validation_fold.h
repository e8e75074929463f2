#pragma once
/// Choosing settings without looking at the views that judge them.

#include <vector>

#include "src/capture/capture.h"

namespace cnerf::test {

/// Drops the held-out views and holds out every `every`-th of the others in their place.
inline void hold_out_of_training(Capture& capture, int every) {
  constexpr std::uint32_t kGone = ~0u;
  std::vector<std::uint32_t> place(capture.views.size(), kGone);
  std::uint32_t kept = 0;
  for (std::size_t i = 0; i < place.size(); ++i) {
    if (!capture.views[i].held_out) place[i] = kept++;
  }
  std::erase_if(capture.views, [](const View& view) { return view.held_out; });
  for (SparsePoint& point : capture.points) {
    for (std::uint32_t& view : point.views) view = place[view];
    std::erase(point.views, kGone);
  }
  for (std::size_t i = 0; i < capture.views.size(); ++i) {
    capture.views[i].held_out = i % std::size_t(every) == std::size_t(every) / 2;
  }
}

/// Trains on every `every`-th view alone and holds all others out: an album of a few photographs.
inline void train_on_few(Capture& capture, int every) {
  for (std::size_t i = 0; i < capture.views.size(); ++i) capture.views[i].held_out = i % std::size_t(every) != 0;
}

}  // namespace cnerf::test
