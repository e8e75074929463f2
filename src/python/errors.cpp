/// Errors of the library as exceptions of Python.

#include <array>
#include <filesystem>
#include <string>
#include <utility>

#include "src/base/error.h"
#include "src/python/bindings.h"

namespace cnerf::python {
namespace py = pybind11;
namespace {

constexpr std::array<std::pair<ExitCode, const char*>, 10> kTypes = {{{ExitCode::kUsage, "UsageError"},
                                                                      {ExitCode::kInput, "InputError"},
                                                                      {ExitCode::kMissingInput, "MissingInputError"},
                                                                      {ExitCode::kDevice, "DeviceError"},
                                                                      {ExitCode::kOutput, "OutputError"},
                                                                      {ExitCode::kBusy, "BusyError"},
                                                                      {ExitCode::kColorizer, "ColorizerError"},
                                                                      {ExitCode::kPoses, "PosesError"},
                                                                      {ExitCode::kSnapshot, "SnapshotError"},
                                                                      {ExitCode::kDiverged, "DivergedError"}}};

/// Types that live as long as the interpreter.
struct ErrorTypes {
  PyObject* base = nullptr;
  std::array<PyObject*, kTypes.size()> types{};
};
ErrorTypes error_types;  // NOLINT: a module is there once per process

void raise(const Error& error) {
  PyObject* type = error_types.base;
  for (std::size_t i = 0; i < kTypes.size(); ++i) {
    if (kTypes[i].first == error.exit_code()) type = error_types.types[i];
  }
  PyErr_SetString(type, error.what());
}

/// As Python's own functions do for the same failure, unless an input cannot be read.
void raise(const std::filesystem::filesystem_error& error) {
  if (exit_code_of(error) == ExitCode::kInput) return raise(InputError(error.path1(), "", error.code().message()));
  const py::tuple arguments = py::make_tuple(error.code().value(), error.code().message(), error.path1().string());
  PyErr_SetObject(PyExc_OSError, arguments.ptr());
}

PyObject* make_type(py::module_& module, const char* name, const char* about, PyObject* base) {
  PyObject* type = PyErr_NewExceptionWithDoc((std::string("cnerf.") + name).c_str(), about, base, nullptr);
  if (type == nullptr) throw py::error_already_set();
  module.attr(name) = py::handle(type);
  return type;
}

}  // namespace

void bind_errors(py::module_& module) {
  error_types.base = make_type(module, "Error",
                               "Base of every error that a user should read. `exit_code` is what the program cnerf "
                               "would end with.",
                               PyExc_RuntimeError);
  for (std::size_t i = 0; i < kTypes.size(); ++i) {
    const auto& [code, name] = kTypes[i];
    error_types.types[i] = make_type(module, name, nullptr, error_types.base);
    py::handle(error_types.types[i]).attr("exit_code") = int(code);
  }
  py::register_local_exception_translator([](std::exception_ptr thrown) {
    if (!thrown) return;
    try {
      std::rethrow_exception(std::move(thrown));
    } catch (const Interrupted& interruption) {
      PyErr_SetString(PyExc_KeyboardInterrupt, interruption.what());
    } catch (const Error& error) {
      raise(error);
    } catch (const std::filesystem::filesystem_error& error) {
      raise(error);
    }
  });
}

}  // namespace cnerf::python
