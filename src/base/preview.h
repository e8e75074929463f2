#pragma once
/// Pictures of work while it runs, for whoever watches. Drawing costs time: the watcher says when.

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

namespace cnerf {

/// A small picture of what work has made so far, beside what it should become. Linear light.
struct PreviewPicture {
  std::string name;
  int width = 0, height = 0;
  std::vector<float> ours;   ///< [H, W] luminance or [H, W, 3] Rec.709
  std::vector<float> input;  ///< [H, W] luminance
};

/// Draws one of a few pictures, counted round.
using DrawPreview = std::function<PreviewPicture(std::size_t index)>;
/// Is offered, between two steps, to have pictures drawn; calls `draw` or does not, and keeps it no longer.
using PreviewSink = std::function<void(const DrawPreview& draw)>;

}  // namespace cnerf
