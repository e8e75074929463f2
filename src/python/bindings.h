#pragma once
/// The parts of the module, each of which declares its names in it.

#include <pybind11/pybind11.h>

namespace cnerf::python {

void bind_errors(pybind11::module_& module);
void bind_cameras(pybind11::module_& module);
void bind_fields(pybind11::module_& module);
void bind_runs(pybind11::module_& module);

}  // namespace cnerf::python
