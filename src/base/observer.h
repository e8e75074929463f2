#pragma once
/// The observer of a job (training, colouring, baking, a step of the pipeline): receives progress, messages and
/// previews and may cancel. A job calls it from one thread, between pieces of its work. The defaults ignore everything
/// and let Ctrl-C cancel.

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "src/base/progress.h"

namespace cnerf {

/// A small picture of the current result beside its target. Linear light.
struct PreviewPicture {
  std::string name;
  int width = 0, height = 0;
  std::vector<float> ours;   ///< [H, W] luminance or [H, W, 3] Rec.709
  std::vector<float> input;  ///< [H, W] luminance
};

/// Draws one of a few pictures; the index wraps around.
using DrawPreview = std::function<PreviewPicture(std::size_t index)>;

class Observer {
 public:
  virtual ~Observer() = default;
  virtual void report_progress(const Progress& /*progress*/) {}
  /// A message for the user.
  virtual void say(const std::string& /*text*/) {}
  /// Reports a file or folder that the job has written.
  virtual void wrote(const std::string& /*what*/, const std::filesystem::path& /*path*/) {}
  /// Offers previews of the current result. Drawing takes time, so the observer decides; `draw` is valid until this
  /// returns.
  virtual void offer_preview(const DrawPreview& /*draw*/) {}
  /// Whether the job should prepare for previews at all.
  [[nodiscard]] virtual bool wants_previews() const { return false; }
  /// Polled often; once it is true the job saves what it can and throws Interrupted.
  [[nodiscard]] virtual bool is_cancelled() const { return interruption_requested(); }

  /// For functions that only report progress. Refers to this object.
  [[nodiscard]] ProgressSink progress_sink() {
    return [this](const Progress& progress) { report_progress(progress); };
  }
};

}  // namespace cnerf
