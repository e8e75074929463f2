#pragma once
/// Progress of long work, and the request to end it.

#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace cnerf {

struct Progress {
  std::string task;                                     ///< "stage 1", "bake"
  double fraction = 0;                                  ///< done, in [0, 1]
  std::vector<std::pair<std::string, double>> figures;  ///< "psnr" -> 27.1, "rays/s" -> 2.1e5
};

/// Receives the progress. May throw Interrupted to stop the work at a safe point; it saves its state first if it can.
using ProgressSink = std::function<void(const Progress&)>;

/// True once the user pressed Ctrl-C. Long loops ask between steps, save and throw Interrupted.
[[nodiscard]] bool interruption_requested();
/// The same from within the program.
void request_interruption();
/// Installs the SIGINT and SIGTERM handlers behind `interruption_requested`; a second signal ends the program at once.
void install_interruption_handler();

}  // namespace cnerf
