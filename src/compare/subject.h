#pragma once
/// The captures of a comparison.

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "src/base/observer.h"
#include "src/capture/capture.h"
#include "src/capture/load_capture.h"
#include "src/config/config.h"

namespace cnerf::compare {

/// A capture to compare on.
struct ComparedCapture {
  std::filesystem::path path;
  int downscale = 0;  ///< divides image sizes; 0 = as capture.downscale says
};
/// "fox@4": the folder and what its image sizes are divided by; without "@", as configured.
/// @throws UsageError
[[nodiscard]] ComparedCapture parse_compared_capture(const std::string& text);

/// A capture that was read.
struct Subject {
  std::string name;  ///< of its folder; unique among the subjects
  CaptureOptions options;
  Capture capture;
  std::vector<const View*> evaluated;  ///< of `capture`

  /// The views that a report shows, as indices of `evaluated`.
  [[nodiscard]] std::vector<std::size_t> shown() const;
};

/// Reads the captures; where one holds nothing out, every eighth view is.
/// @param report  folder; what of the photographs does not fit into memory lies on its disk
/// @return  at places that stay
/// @throws UsageError, MissingInputError, InputError  also for a capture without any colour.
[[nodiscard]] std::vector<std::unique_ptr<const Subject>> read_subjects(const std::vector<ComparedCapture>& captures,
                                                                        const Config& config, Observer& observer,
                                                                        const std::filesystem::path& report);

}  // namespace cnerf::compare
