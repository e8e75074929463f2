#include "export/up_axis.h"

#include "src/base/check.h"

namespace cnerf::exporting {
namespace {

constexpr Mat3d kYUpFromX{{{0, -1, 0}, {1, 0, 0}, {0, 0, 1}}};
constexpr Mat3d kYUpFromZ{{{1, 0, 0}, {0, 0, 1}, {0, -1, 0}}};

Mat3d y_up_from(const std::string& up_axis) {
  CNERF_CHECK(up_axis == "x" || up_axis == "y" || up_axis == "z", up_axis);
  return up_axis == "x" ? kYUpFromX : up_axis == "y" ? Mat3d::identity() : kYUpFromZ;
}

}  // namespace

Affined turned_up(const std::string& up_axis, const std::string& to) {
  CNERF_CHECK(to == "y" || to == "z", to);
  if (up_axis == to) return {};
  const Mat3d y_up = y_up_from(up_axis);
  return {to == "y" ? y_up : kYUpFromZ.transposed() * y_up, {}};
}

}  // namespace cnerf::exporting
