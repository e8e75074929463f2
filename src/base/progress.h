#pragma once
/// What long work tells the outside while it runs. The work only calls `report`; how it looks is the caller's matter.

#include <cstddef>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace cnerf {

/// A small picture of what work has made so far, beside what it should become. Linear light.
struct PreviewPicture {
  std::string name;
  int width = 0, height = 0;
  std::vector<float> ours;   ///< [H, W] luminance or [H, W, 3] Rec.709
  std::vector<float> input;  ///< [H, W] luminance
};

struct Progress {
  std::string task;                                     ///< "stage 1", "bake"
  double fraction = 0;                                  ///< done, in [0, 1]
  std::vector<std::pair<std::string, double>> figures;  ///< "psnr" -> 27.1, "rays/s" -> 2.1e5
  /// Draws one of a few pictures, counted round; to be called during the report only. Null where there are none.
  std::function<PreviewPicture(std::size_t index)> preview = nullptr;
};

/// Watches long work. May throw Interrupted to stop it at a safe point; the work saves its state first if it can.
using ProgressSink = std::function<void(const Progress&)>;

/// True once the user pressed Ctrl-C. Long loops ask between steps, save and throw Interrupted.
[[nodiscard]] bool interruption_requested();
/// As Ctrl-C, from within the program.
void request_interruption();
/// Installs the SIGINT and SIGTERM handlers behind `interruption_requested`; a second signal ends the program at once.
void install_interruption_handler();

}  // namespace cnerf
