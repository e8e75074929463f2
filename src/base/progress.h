#pragma once
/// What long work tells the outside while it runs. The work only calls `report`; how it looks is the caller's matter.

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

/// Watches long work. May throw Interrupted to stop it at a safe point; the work saves its state first if it can.
using ProgressSink = std::function<void(const Progress&)>;

/// True once the user pressed Ctrl-C. Long loops ask between steps, save and throw Interrupted.
[[nodiscard]] bool interruption_requested();
/// Installs the SIGINT and SIGTERM handlers behind `interruption_requested`; a second signal ends the program at once.
void install_interruption_handler();

}  // namespace cnerf
