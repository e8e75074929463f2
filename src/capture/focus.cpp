#include "src/capture/focus.h"

#include <cmath>

namespace cnerf {

Vec3d focus_point(const std::vector<View>& views) {
  Mat3d normal{};
  Vec3d right{}, mean_position{}, mean_axis{};
  for (const View& view : views) {
    const Vec3d d = normalized(view.world_from_camera.linear.column(2));
    const Vec3d o = view.world_from_camera.translation;
    for (int i = 0; i < 3; ++i) {
      Vec3d row{};
      for (int j = 0; j < 3; ++j) row[j] = (i == j ? 1.0 : 0.0) - d[i] * d[j];
      normal.rows[i] += row;
      right[i] += dot(row, o);
    }
    mean_position += o / double(views.size());
    mean_axis += d / double(views.size());
  }
  if (normal.determinant() < 1e-4 * std::pow(double(views.size()), 3)) return mean_position + mean_axis;
  return normal.inverse() * right;
}

}  // namespace cnerf
