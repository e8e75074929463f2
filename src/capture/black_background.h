#pragma once
/// Objects photographed before black: a studio, a turntable, a night sky. What is black all around is nothing to
/// reconstruct. Taken as it is, it becomes a black shell around the object.

#include <functional>
#include <vector>

#include "src/capture/capture.h"

namespace cnerf {

/// Cuts the object out if every view shows it before black: pixels that are connected to the picture's rim through
/// black get an alpha of 0. Dark parts within the object stay. Views that have alpha already, or a rim that is not
/// black and even, leave all views as they are.
/// @param changed  is told of each image that was cut out
/// @return  whether the views were cut out.
bool cut_out_of_black(
    std::vector<View>& views, const std::function<void(MonoImage&)>& changed = [](MonoImage&) {});

}  // namespace cnerf
