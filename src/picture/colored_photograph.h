#pragma once
/// A photograph in its own grey and the chroma of another picture.

#include <opencv2/core.hpp>
#include <vector>

#include "src/picture/joint_upsampling.h"

namespace cnerf {

struct GreyPhotograph {
  int width = 0, height = 0;
  std::vector<float> luminance;  ///< [H, W] linear, 1 = white; not multiplied by the coverage
  std::vector<float> alpha;      ///< [H, W] coverage in [0, 1]; empty = opaque
};

/// sRGB of 16 bits, B G R or B G R A (not premultiplied) as OpenCV has them. Each pixel has the photograph's L*, and
/// chroma from the samples, brought up by `JointUpsampler` and reduced at that L* where sRGB has not as much. Light
/// beyond white is white, as in any such file.
[[nodiscard]] cv::Mat colored_photograph(const GreyPhotograph& photograph, const ChromaSamples& chroma);

}  // namespace cnerf
