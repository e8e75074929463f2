#pragma once
/// Watches a job: training, colouring, baking, a step of the pipeline. A job calls it from one thread, between pieces
/// of its work. The defaults watch nothing and let Ctrl-C cancel.

#include <filesystem>
#include <string>

#include "src/base/preview.h"
#include "src/base/progress.h"

namespace cnerf {

class Observer {
 public:
  virtual ~Observer() = default;
  virtual void report_progress(const Progress& /*progress*/) {}
  /// A sentence about what happens.
  virtual void say(const std::string& /*text*/) {}
  /// A file or folder that the job leaves behind.
  virtual void wrote(const std::string& /*what*/, const std::filesystem::path& /*path*/) {}
  /// Offers pictures of what the job has made so far; `draw` may be called until this returns.
  virtual void offer_preview(const DrawPreview& /*draw*/) {}
  /// Whether offering is worth the preparation that previews take.
  [[nodiscard]] virtual bool wants_previews() const { return false; }
  /// Asked often; once it is true the job saves what it can and throws Interrupted.
  [[nodiscard]] virtual bool is_cancelled() const { return interruption_requested(); }

  /// For work that wants no more of an observer than its progress. Refers to this object.
  [[nodiscard]] ProgressSink progress_sink() {
    return [this](const Progress& progress) { report_progress(progress); };
  }
};

}  // namespace cnerf
