#pragma once
/// Steps of the pipeline called from Python: progress goes to a function, messages to Python's logging, Ctrl-C stops
/// a step where it can be gone on with.

#include <pybind11/functional.h>
#include <pybind11/pybind11.h>

#include <atomic>
#include <functional>
#include <optional>

#include "src/base/observer.h"

namespace cnerf::python {
namespace py = pybind11;

/// Takes the GIL where it calls Python; the step runs without it.
class StepObserver final : public Observer {
 public:
  /// @param progress  None, or called with task, fraction and a dict of figures
  explicit StepObserver(py::object progress);
  ~StepObserver() override;
  StepObserver(const StepObserver&) = delete;
  StepObserver& operator=(const StepObserver&) = delete;

  /// @throws Interrupted  where a call failed before: for steps that ask nobody whether to stop
  void report_progress(const Progress& progress) override;
  void say(const std::string& text) override;
  void wrote(const std::string& what, const std::filesystem::path& path) override;
  [[nodiscard]] bool is_cancelled() const override { return has_failed_ || Observer::is_cancelled(); }

  /// What the function raised: the step was then stopped as by Ctrl-C, and no other one.
  [[nodiscard]] std::optional<py::error_already_set>& failure() { return failure_; }

 private:
  /// Calls Python, until that raises something: it is kept.
  void guarded(const std::function<void()>& call);

  py::object progress_, logger_;
  std::optional<py::error_already_set> failure_;
  std::atomic<bool> has_failed_ = false;  // several threads ask
};

/// Runs a step without the GIL. While it runs Ctrl-C asks it to stop; it then saves what it can, and
/// KeyboardInterrupt is raised.
/// @throws  as the step; what the progress function raised
void run_step(const py::object& progress, const std::function<void(Observer&)>& step);

}  // namespace cnerf::python
