#include "src/python/fields.h"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <optional>

#include "bake/camera.h"
#include "bake/volume/integrate.h"
#include "export/manifest.h"
#include "export/vdb_reader.h"
#include "export/web_pictures.h"
#include "src/pipeline/picture_files.h"
#include "src/python/arrays.h"
#include "src/python/bindings.h"
#include "src/python/field_query.h"

namespace cnerf::python {
namespace fs = std::filesystem;
namespace {

/// What a camera sees. [H, W, 3] and [H, W]; None where it is not known.
struct Image {
  py::object rgb, opacity, luminance = py::none(), depth = py::none();
};

struct OpenBake {
  fs::path folder;
  exporting::BakeManifest manifest;
  std::vector<bake::Volume> volumes;
  bake::VolumeLookup lookup{volumes};

  explicit OpenBake(const fs::path& where)
      : folder(where),
        manifest(exporting::read_manifest(where / "manifest.json")),
        volumes(exporting::read_volumes(where)) {}
};

py::array_t<double> box_array(const Aabbd& box) {
  py::array_t<double> array({2, 3});
  for (int axis = 0; axis < 3; ++axis) {
    array.mutable_at(0, axis) = box.min[axis];
    array.mutable_at(1, axis) = box.max[axis];
  }
  return array;
}

py::array_t<float> density_of_scene(const OpenScene& self, const Numbers& points) {
  const Vectors at("points", points);
  py::array_t<float> sigma(at.shape());
  const std::span<float> values = values_of(sigma);
  const py::gil_scoped_release release;
  query_density(*self.scene, at.values(), values);
  return sigma;
}

/// Of unit length.  @throws UsageError
std::vector<Vec3d> unit_directions(const Vectors& directions, const Vectors& points) {
  if (!directions.shape().empty() && directions.shape() != points.shape()) {
    throw UsageError("directions: expected one, or as many as points");
  }
  std::vector<Vec3d> unit;
  for (const Vec3d& direction : directions.values()) {
    if (length(direction) == 0) throw UsageError("directions: expected other vectors than 0");
    unit.push_back(normalized(direction));
  }
  return unit;
}

py::array_t<float> color_of_scene(const OpenScene& self, const Numbers& points, const Numbers& directions) {
  const Vectors at("points", points);
  const std::vector<Vec3d> along = unit_directions(Vectors("directions", directions), at);
  py::array_t<float> rgb(at.vector_shape());
  const std::span<Vec3f> values = vectors_of(rgb);
  const py::gil_scoped_release release;
  query_color(*self.scene, at.values(), along, values);
  return rgb;
}

Image view_of_scene(const OpenScene& self, const bake::Camera& camera, bool baked, std::optional<int> steps_per_box) {
  RenderOptions options = self.options;
  if (steps_per_box) options.steps_per_box = *steps_per_box;
  if (options.steps_per_box < 1) throw UsageError("steps_per_box: expected at least 1");
  options.color = self.scene->is_colorized() && !baked;
  options.baked_color = self.scene->is_colorized() && baked;
  RenderedImage seen;
  std::vector<float> rgb;
  {
    const py::gil_scoped_release release;
    seen = self.scene->render(camera.intrinsics, camera.world_from_camera, options);
    rgb = pipeline::shown_rgb(seen, baked ? pipeline::ShownColor::kBaked : pipeline::ShownColor::kDecoded);
  }
  return {array_of(rgb, {seen.height, seen.width, 3}), array_of(seen.opacity, {seen.height, seen.width}),
          array_of(seen.luminance, {seen.height, seen.width}), array_of(seen.depth, {seen.height, seen.width})};
}

/// Density and colour of a bake at points.
std::pair<py::array_t<float>, py::array_t<float>> ask_bake(const OpenBake& self, const Numbers& points) {
  const Vectors at("points", points);
  py::array_t<float> sigma(at.shape()), rgb(at.vector_shape());
  const std::span<float> density = values_of(sigma);
  const std::span<Vec3f> color = vectors_of(rgb);
  {
    const py::gil_scoped_release release;  // copies of arrays count their references, which needs the GIL
    self.lookup.query(at.values(), density, color);
  }
  return {sigma, rgb};
}

Image view_of_bake(const OpenBake& self, const bake::Camera& camera, int samples_per_axis) {
  if (samples_per_axis < 1) throw UsageError("samples_per_axis: expected at least 1");
  bake::VolumeImage seen;
  {
    const py::gil_scoped_release release;
    seen = bake::integrate_volumes(self.volumes, camera.intrinsics, camera.world_from_camera,
                                   {.samples_per_axis = samples_per_axis});
  }
  return {array_of(seen.rgb, {seen.height, seen.width, 3}), array_of(seen.opacity, {seen.height, seen.width})};
}

std::vector<bake::Camera> cameras_of_bake(const OpenBake& self) {
  std::vector<bake::Camera> cameras = self.manifest.cameras;
  for (bake::Camera& camera : cameras) camera.intrinsics = exporting::without_distortion(camera.intrinsics);
  return cameras;
}

}  // namespace

void bind_fields(py::module_& module) {
  py::class_<Image>(module, "Image", "What a camera sees: linear Rec.709, premultiplied by opacity.")
      .def_readonly("rgb", &Image::rgb)
      .def_readonly("opacity", &Image::opacity)
      .def_readonly("luminance", &Image::luminance)
      .def_readonly("depth", &Image::depth);
  py::class_<OpenScene>(module, "Scene", "A trained field, as its pictures show it. Made by Run.scene.")
      .def_readonly("take", &OpenScene::take)
      .def_property_readonly("colorizer", [](const OpenScene& self) { return self.scene->colorizer(); })
      .def_property_readonly("box", [](const OpenScene& self) { return box_array(self.scene->frame().world_box()); })
      .def("density", &density_of_scene, py::arg("points"),
           "Density at points [..., 3] in world units: [...], 1/world unit.")
      .def("color", &color_of_scene, py::arg("points"), py::arg("directions"),
           "Linear Rec.709 at points [..., 3], seen along directions [..., 3] or one for all.")
      .def("render", &view_of_scene, py::arg("camera"), py::kw_only(), py::arg("baked") = false,
           py::arg("steps_per_box") = py::none(), "The view of a camera, as `cnerf render` makes it.");
  py::class_<OpenBake>(module, "Bake", "The volume of a bake. Made by open_bake.")
      .def_readonly("folder", &OpenBake::folder)
      .def_property_readonly("take", [](const OpenBake& self) { return self.manifest.label.provenance.take; })
      .def_property_readonly("box", [](const OpenBake& self) { return box_array(self.manifest.volume->bounds); })
      .def_property_readonly("cameras", &cameras_of_bake, "The capture's cameras, without lens distortion.")
      .def(
          "density", [](const OpenBake& self, const Numbers& points) { return ask_bake(self, points).first; },
          py::arg("points"), "Density at points [..., 3] in world units: [...], 1/world unit.")
      .def(
          "color", [](const OpenBake& self, const Numbers& points) { return ask_bake(self, points).second; },
          py::arg("points"), "Linear Rec.709 at points [..., 3]; 0 where nothing is.")
      .def("render", &view_of_bake, py::arg("camera"), py::kw_only(), py::arg("samples_per_axis") = 4,
           "The view of a camera, as `cnerf render BAKE` makes it.");
  module.def(
      "open_bake", [](const fs::path& folder) { return std::make_unique<OpenBake>(folder); }, py::arg("folder"),
      py::call_guard<py::gil_scoped_release>(), "Opens the volume of a bake.");
}

}  // namespace cnerf::python
