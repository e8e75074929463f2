/// Cameras.

#include <pybind11/stl.h>

#include <optional>

#include "bake/camera.h"
#include "src/capture/pose.h"
#include "src/python/arrays.h"
#include "src/python/bindings.h"

namespace cnerf::python {
namespace {

/// Of three or four rows of four.  @throws UsageError  another shape, or no pose
Affined affine_of(const Numbers& matrix) {
  const bool fits = matrix.ndim() == 2 && (matrix.shape(0) == 3 || matrix.shape(0) == 4) && matrix.shape(1) == 4;
  if (!fits) throw UsageError("world_from_camera: expected an array of shape [4, 4] or [3, 4]");
  Affined map;
  for (int row = 0; row < 3; ++row) {
    map.linear.rows[row] = {matrix.at(row, 0), matrix.at(row, 1), matrix.at(row, 2)};
    map.translation[row] = matrix.at(row, 3);
  }
  try {
    return rigid_pose(map, "world_from_camera", "");
  } catch (const InputError& error) {  // of no file here
    throw UsageError(error.what());
  }
}

py::array_t<double> matrix_of(const Affined& map) {
  py::array_t<double> matrix({4, 4});
  auto at = matrix.mutable_unchecked<2>();
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 3; ++column) at(row, column) = row < 3 ? map.linear.rows[row][column] : 0;
    at(row, 3) = row < 3 ? map.translation[row] : 1;
  }
  return matrix;
}

struct Lens {
  int width, height;
  double fx;
  std::optional<double> fy, cx, cy;
};

bake::Camera make_camera(const Numbers& world_from_camera, const Lens& lens, const std::string& name) {
  if (lens.width < 1 || lens.height < 1) throw UsageError("width, height: expected at least 1 pixel");
  bake::Camera camera{name, {}, affine_of(world_from_camera)};
  camera.intrinsics.width = lens.width;
  camera.intrinsics.height = lens.height;
  camera.intrinsics.fx = lens.fx;
  camera.intrinsics.fy = lens.fy.value_or(lens.fx);
  camera.intrinsics.cx = lens.cx.value_or(lens.width / 2.0);
  camera.intrinsics.cy = lens.cy.value_or(lens.height / 2.0);
  const auto found = implausible_number(camera.intrinsics, camera.world_from_camera.translation);
  if (found) throw UsageError(found->field + ": " + found->problem);
  return camera;
}

/// Through the centres of pixels: where they begin, [3], and unit directions, [H, W, 3].
py::tuple rays_of(const bake::Camera& camera) {
  const Intrinsics& lens = camera.intrinsics;
  py::array_t<double> origin(3), directions({lens.height, lens.width, 3});
  for (int axis = 0; axis < 3; ++axis) origin.mutable_at(axis) = camera.world_from_camera.translation[axis];
  auto at = directions.mutable_unchecked<3>();
  for (int y = 0; y < lens.height; ++y) {
    for (int x = 0; x < lens.width; ++x) {
      const Vec3d direction =
          normalized(camera.world_from_camera.direction(ray_direction(lens, PixelPosition{x + 0.5, y + 0.5})));
      for (int axis = 0; axis < 3; ++axis) at(y, x, axis) = direction[axis];
    }
  }
  return py::make_tuple(origin, directions);
}

bake::Camera resized_camera(const bake::Camera& camera, int width, int height) {
  if (width < 1 || height < 1) throw UsageError("width, height: expected at least 1 pixel");
  return {camera.name, resized(camera.intrinsics, width, height), camera.world_from_camera};
}

template <typename Value>
auto lens_value(Value Intrinsics::*member) {
  return [member](const bake::Camera& camera) { return camera.intrinsics.*member; };
}

}  // namespace

void bind_cameras(py::module_& module) {
  py::class_<bake::Camera>(module, "Camera",
                           "A camera: +X right, +Y down, +Z forward; the centre of the first pixel is (0.5, 0.5).")
      .def(py::init([](const Numbers& world_from_camera, int width, int height, double fx, std::optional<double> fy,
                       std::optional<double> cx, std::optional<double> cy, const std::string& name) {
             return make_camera(world_from_camera, {width, height, fx, fy, cx, cy}, name);
           }),
           py::arg("world_from_camera"), py::arg("width"), py::arg("height"), py::arg("fx"), py::arg("fy") = py::none(),
           py::arg("cx") = py::none(), py::arg("cy") = py::none(), py::arg("name") = "")
      .def_readonly("name", &bake::Camera::name)
      .def_property_readonly("width", lens_value(&Intrinsics::width))
      .def_property_readonly("height", lens_value(&Intrinsics::height))
      .def_property_readonly("fx", lens_value(&Intrinsics::fx))
      .def_property_readonly("fy", lens_value(&Intrinsics::fy))
      .def_property_readonly("cx", lens_value(&Intrinsics::cx))
      .def_property_readonly("cy", lens_value(&Intrinsics::cy))
      .def_property_readonly("world_from_camera",
                             [](const bake::Camera& camera) { return matrix_of(camera.world_from_camera); })
      .def("rays", &rays_of, "Where the rays of the pixels begin, [3], and their unit directions, [H, W, 3].")
      .def("resized", &resized_camera, py::arg("width"), py::arg("height"), "The same camera for a resized picture.")
      .def("__repr__", [](const bake::Camera& camera) {
        return "<cnerf.Camera '" + camera.name + "' " + std::to_string(camera.intrinsics.width) + "x" +
               std::to_string(camera.intrinsics.height) + ">";
      });
}

}  // namespace cnerf::python
