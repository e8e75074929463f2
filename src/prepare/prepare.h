#pragma once
/// From photographs or a film clip to a capture: images, transforms.json, points, prepare.json, a contact sheet.

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "src/base/options.h"
#include "src/base/progress.h"
#include "src/prepare/photographs.h"
#include "src/prepare/spike_stream.h"
#include "src/prepare/upright.h"
#include "src/prepare/video.h"

namespace cnerf::prepare {

struct PrepareOptions {
  std::string masks;
  std::string colmap_model;
  bool no_exposure = false;
  bool haze = false;
  SensorOptions sensor;
  VideoOptions video;
  SpikeOptions spikes;
  FrameOptions frame;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("masks", masks,
      "folder of masks named as the photographs, black = ignore; for a clip also one picture for all frames");
    v("colmap_model", colmap_model, "folder of a ready COLMAP model, instead of making one");
    v("no_exposure", no_exposure, "take all views as equally exposed");
    v("haze", haze, "besides exposures, estimate light that lies over each view: fog of old film, stray light");
    sensor.visit(v);
    video.visit(v);
    spikes.visit(v);
    frame.visit(v);
  }
};

/// Refuses what can be told to be wrong before a file is read or a folder is cleared.
/// @throws UsageError  texts that cannot be read, options that exclude each other; names them
void check_options(const PrepareOptions& options);

/// What the user is told meanwhile.
using Say = std::function<void(const std::string&)>;

struct PrepareReport {
  std::size_t images = 0;      ///< read
  std::size_t registered = 0;  ///< of them with a pose
};

/// True for a path that `prepare_capture` takes: a folder of photographs, or a file that can be a clip; false for a
/// capture, which has poses already, and for what is neither.
[[nodiscard]] bool needs_preparing(const std::filesystem::path& source);

/// Makes a capture of `source` in the folder `capture`. Its subfolder `work` keeps what an interrupted call needs to go
/// on, and COLMAP's log; it may be deleted afterwards. transforms.json is written last.
/// @throws UsageError, MissingInputError, InputError  bad options or files, each named.
/// @throws DeviceError  COLMAP is missing.
/// @throws PosesError  no or too few poses, with the reason and advice.
/// @throws Interrupted  what is done stays.
PrepareReport prepare_capture(const std::filesystem::path& source, const std::filesystem::path& capture,
                              const PrepareOptions& options, const ProgressSink& progress, const Say& say);

}  // namespace cnerf::prepare
