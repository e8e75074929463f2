#pragma once
/// A cell of a comparison: what one method measures on one capture with one seed.

#include <string>
#include <vector>

#include "src/base/record.h"
#include "src/compare/consistency.h"
#include "src/compare/learning_curve.h"
#include "src/evaluate/evaluate.h"

namespace cnerf::compare {

struct Cell {
  std::string capture, method;
  int seed = 1;
  std::string settings;  ///< digest of all that went in; a cell of other settings is made again
  std::string error;     ///< why the method failed; empty = it did not
  Metrics metrics;       ///< over the evaluated views
  Consistency short_range, long_range;
  int accepted = 0, rejected = 0;  ///< answers of the colorizer
  double seconds = 0;              ///< that stage 2 took
  /// Of `colornerf` and of methods with a field of their own: PSNR of luminance during stage 1, ab error during
  /// stage 2.
  std::vector<LearningPoint> stage1_curve, stage2_curve;

  /// cell.json
  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("capture", self.capture);
    v("method", self.method);
    v("seed", self.seed);
    v("settings", self.settings);
    v("error", self.error, kOptional);
    v("metrics", self.metrics);
    v("short_range", self.short_range);
    v("long_range", self.long_range);
    v("accepted", self.accepted);
    v("rejected", self.rejected);
    v("seconds", self.seconds);
    v("stage1_curve", self.stage1_curve, kOptional);
    v("stage2_curve", self.stage2_curve, kOptional);
  }
};

}  // namespace cnerf::compare
