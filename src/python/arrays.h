#pragma once
/// NumPy arrays in and out.

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <cmath>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "src/base/error.h"
#include "src/base/vec3.h"

namespace cnerf::python {
namespace py = pybind11;

/// Whatever NumPy makes doubles of.
using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// Vectors [..., 3] of an array, which they keep.
class Vectors {
 public:
  /// @param what  they are called in errors.  @throws UsageError  another shape, or numbers that are not finite
  Vectors(const char* what, Numbers array) : array_(std::move(array)) {
    const bool fits = array_.ndim() > 0 && array_.shape(array_.ndim() - 1) == 3;
    if (!fits) throw UsageError(std::string(what) + ": expected an array of shape [..., 3]");
    shape_.assign(array_.shape(), array_.shape() + array_.ndim() - 1);
    values_ = {reinterpret_cast<const Vec3d*>(array_.data()), std::size_t(array_.size() / 3)};
    for (const Vec3d& v : values_) {
      if (std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z)) continue;
      throw UsageError(std::string(what) + ": expected finite numbers");
    }
  }

  [[nodiscard]] std::span<const Vec3d> values() const { return values_; }
  /// The array's without the last axis.
  [[nodiscard]] const std::vector<py::ssize_t>& shape() const { return shape_; }
  /// The array's own.
  [[nodiscard]] std::vector<py::ssize_t> vector_shape() const {
    std::vector<py::ssize_t> shape = shape_;
    shape.push_back(3);
    return shape;
  }

 private:
  static_assert(sizeof(Vec3d) == 3 * sizeof(double) && sizeof(Vec3f) == 3 * sizeof(float));
  Numbers array_;
  std::vector<py::ssize_t> shape_;
  std::span<const Vec3d> values_;
};

[[nodiscard]] inline std::span<float> values_of(py::array_t<float>& array) {
  return {array.mutable_data(), std::size_t(array.size())};
}
[[nodiscard]] inline std::span<Vec3f> vectors_of(py::array_t<float>& array) {
  return {reinterpret_cast<Vec3f*>(array.mutable_data()), std::size_t(array.size() / 3)};
}
/// A copy, in NumPy's memory.
[[nodiscard]] inline py::array_t<float> array_of(const std::vector<float>& values, std::vector<py::ssize_t> shape) {
  return py::array_t<float>(std::move(shape), values.data());
}

}  // namespace cnerf::python
