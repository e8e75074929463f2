#include "src/python/steps.h"

#include <csignal>
#include <mutex>
#include <utility>

#include "src/base/error.h"

namespace cnerf::python {
namespace {

/// Ctrl-C asks steps to stop while there is one of these. Python's own handler is put back by the last.
class StoppedByCtrlC {
 public:
  StoppedByCtrlC() {
    const std::lock_guard lock(mutex());
    if (++count() > 1) return;
    struct sigaction ours {};
    ours.sa_handler = [](int) { request_interruption(); };
    ::sigaction(SIGINT, nullptr, &former());
    if (former().sa_handler != SIG_IGN) ::sigaction(SIGINT, &ours, nullptr);
  }
  ~StoppedByCtrlC() {
    const std::lock_guard lock(mutex());
    if (--count() > 0) return;
    ::sigaction(SIGINT, &former(), nullptr);
    forget_interruption();
  }
  StoppedByCtrlC(const StoppedByCtrlC&) = delete;
  StoppedByCtrlC& operator=(const StoppedByCtrlC&) = delete;

 private:
  static std::mutex& mutex() {
    static std::mutex one;
    return one;
  }
  static int& count() {
    static int steps = 0;
    return steps;
  }
  static struct sigaction& former() {
    static struct sigaction action {};
    return action;
  }
};

}  // namespace

StepObserver::StepObserver(py::object progress)
    : progress_(std::move(progress)), logger_(py::module_::import("logging").attr("getLogger")("cnerf")) {}

StepObserver::~StepObserver() = default;

void StepObserver::guarded(const std::function<void()>& call) {
  if (has_failed_) return;
  const py::gil_scoped_acquire acquire;
  try {
    call();
  } catch (py::error_already_set& error) {
    failure_.emplace(std::move(error));
    has_failed_ = true;
  }
}

void StepObserver::report_progress(const Progress& progress) {
  if (has_failed_) throw Interrupted("stopped by its progress function");
  if (progress_.is_none()) return;
  guarded([&] {
    py::dict figures;
    for (const auto& [name, value] : progress.figures) figures[name.c_str()] = value;
    progress_(progress.task, progress.fraction, figures);
  });
}

void StepObserver::say(const std::string& text) {
  guarded([&] { logger_.attr("info")("%s", text); });
}

void StepObserver::wrote(const std::string& what, const std::filesystem::path& path) {
  guarded([&] { logger_.attr("info")("%s: %s", what, path.string()); });
}

void run_step(const py::object& progress, const std::function<void(Observer&)>& step) {
  StepObserver observer(progress);
  bool was_stopped = false;
  try {
    const StoppedByCtrlC stopped_by_ctrl_c;
    const py::gil_scoped_release release;
    step(observer);
    was_stopped = interruption_requested();  // too late to stop anything
  } catch (const Interrupted&) {
    if (!observer.failure()) throw;
  }
  if (observer.failure()) throw std::move(*observer.failure());
  if (was_stopped) PyErr_SetInterrupt();
}

}  // namespace cnerf::python
