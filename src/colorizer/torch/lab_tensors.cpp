#include "src/colorizer/torch/lab_tensors.h"

#include <vector>

#include "src/color/colorspace_math.h"

namespace cnerf {
using torch::Tensor;

namespace {

Tensor linear_from_srgb_tensor(const Tensor& v) {
  return torch::where(v <= 0.04045, v / 12.92, torch::pow((v.clamp_min(0.04045) + 0.055) / 1.055, 2.4));
}

Tensor srgb_from_linear_tensor(const Tensor& v) {
  return torch::where(v <= 0.0031308, v * 12.92, 1.055 * torch::pow(v.clamp_min(0.0031308), 1 / 2.4) - 0.055);
}

Tensor inverse_lab_f_tensor(const Tensor& f) {
  constexpr double epsilon = LabConstants<double>::epsilon, kappa = LabConstants<double>::kappa;
  const Tensor cube = f * f * f;
  return torch::where(cube > epsilon, cube, (116 * f - 16) / kappa);
}

Tensor lab_f_tensor(const Tensor& t) {
  constexpr double epsilon = LabConstants<double>::epsilon, kappa = LabConstants<double>::kappa;
  return torch::where(t > epsilon, torch::pow(t.clamp_min(epsilon), 1.0 / 3), (kappa * t + 16) / 116);
}

}  // namespace

LabPlanes lab_from_srgb(const Tensor& srgb) {
  const Tensor linear = linear_from_srgb_tensor(srgb);
  const Tensor r = linear.slice(1, 0, 1), g = linear.slice(1, 1, 2), b = linear.slice(1, 2, 3);
  const auto f_of = [&](const Vec3<double>& row) { return lab_f_tensor(r * row.x + g * row.y + b * row.z); };
  // The columns of the conversion are what it makes of the three primaries.
  const Vec3<double> red = relative_xyz_from_linear_rgb(Vec3<double>{1, 0, 0});
  const Vec3<double> green = relative_xyz_from_linear_rgb(Vec3<double>{0, 1, 0});
  const Vec3<double> blue = relative_xyz_from_linear_rgb(Vec3<double>{0, 0, 1});
  const Tensor fx = f_of({red.x, green.x, blue.x}), fy = f_of({red.y, green.y, blue.y}),
               fz = f_of({red.z, green.z, blue.z});
  return {116 * fy - 16, torch::cat({500 * (fx - fy), 200 * (fy - fz)}, 1)};
}

Tensor srgb_from_lab(const Tensor& lightness, const Tensor& ab) {
  const Tensor fy = (lightness + 16) / 116;
  const Tensor x = inverse_lab_f_tensor(fy + ab.slice(1, 0, 1) / 500), y = inverse_lab_f_tensor(fy),
               z = inverse_lab_f_tensor(fy - ab.slice(1, 1, 2) / 200);
  std::vector<Tensor> channels;
  for (int channel = 0; channel < 3; ++channel) {
    const auto of = [&](const Vec3<double>& xyz) { return linear_rgb_from_relative_xyz(xyz)[channel]; };
    channels.push_back(of({1, 0, 0}) * x + of({0, 1, 0}) * y + of({0, 0, 1}) * z);
  }
  return srgb_from_linear_tensor(torch::cat(channels, 1).clamp(0, 1));
}

Tensor srgb_from_lightness(const Tensor& lightness) {
  return srgb_from_linear_tensor(inverse_lab_f_tensor((lightness + 16) / 116));
}

}  // namespace cnerf
