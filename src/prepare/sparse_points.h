#pragma once
/// Sparse points of a capture whose poses are known: features of its training views, matched along epipolar lines and
/// triangulated with the poses held.

#include <vector>

#include "src/base/observer.h"
#include "src/capture/capture.h"
#include "src/train/luminance/stage1.h"

namespace cnerf::prepare {

/// Held-out views are not looked at. The same capture gives the same points. The observer is told how far it is.
/// @return  points that at least three views show, from directions that differ
/// @throws Interrupted  when the observer cancels; after a few views or pairs at most
[[nodiscard]] std::vector<SparsePoint> find_sparse_points(const Capture& capture, Observer& observer);

/// Whether the capture has points of which it is known who sees them.
[[nodiscard]] bool has_seen_points(const Capture& capture);

/// What a stage 1 is to know besides the capture: points, if the job asks for free space or depths, the capture has
/// none of its own whose views it knows, and outlines do not bound its space. Says how many were found, and whether
/// they fit so badly that cameras may be inexact, where these are not to be learned.
[[nodiscard]] std::vector<SparsePoint> points_for_training(const Stage1Job& job, Observer& observer);

}  // namespace cnerf::prepare
