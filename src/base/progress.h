#pragma once
/// Progress of long work, and requests to stop it.

#include <atomic>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace cnerf {

struct Progress {
  std::string task;                                     ///< "stage 1", "bake"
  double fraction = 0;                                  ///< of the work that is done, in [0, 1]
  std::vector<std::pair<std::string, double>> figures;  ///< "psnr" -> 27.1, "rays/s" -> 2.1e5
};

/// Receives the progress. It may throw Interrupted, which stops the work at a safe point, after saving if it can.
using ProgressSink = std::function<void(const Progress&)>;

/// Whether the user has pressed Ctrl-C. Long loops check it between steps, save and throw Interrupted.
[[nodiscard]] bool interruption_requested();
/// Installs the SIGINT and SIGTERM handlers behind `interruption_requested`; a second signal ends the program at once.
void install_interruption_handler();
/// For programs with signal handlers of their own: as if the user had pressed Ctrl-C. May be called in a handler.
void request_interruption();
/// For programs that go on after work was stopped.
void forget_interruption();

/// What `interruption_requested` reads. Whoever loads a plug-in hands it over (src/base/plugin.h).
[[nodiscard]] std::atomic<int>* interruption_flag();

}  // namespace cnerf
