#pragma once
/// Which photographs to colour: a suggestion of key frames.

#include <string>
#include <vector>

#include "src/engine/engines.h"
#include "src/pipeline/run_context.h"
#include "src/train/luminance/view_cache.h"

namespace cnerf::pipeline {

struct SuggestedView {
  std::string view;  ///< its name, as the capture has it
  double shows = 0;  ///< share of the scene that it shows
  double adds = 0;   ///< share of the scene that it tells of, beside those before it

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("view", self.view);
    v("shows", self.shows);
    v("adds", self.adds);
  }
};

/// Content of key_views.json.
struct KeyViews {
  int schema_version = 1;
  std::string take;                      ///< whose doubts counted; empty = every point counts as much
  std::vector<std::string> given;        ///< views that have colours already
  std::vector<SuggestedView> suggested;  ///< what to colour first, second, ...
  std::vector<SuggestedView> alone;      ///< every view in the capture's order, as if it were the only one to colour

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("schema_version", self.schema_version);
    v("take", self.take);
    v("given", self.given);
    v("suggested", self.suggested);
    v("alone", self.alone);
  }
};

struct KeyViewsJob {
  int count = 1;                        ///< of views, at most
  std::string take;                     ///< whose doubts count; empty = none
  ViewCache* views = nullptr;           ///< of the run's stage 1; null = traced anew, small
  std::vector<std::string> given = {};  ///< views that have colours already, beside key frames of the configuration
};

/// The views that tell most, see src/train/chroma/key_views.h.
/// @throws UsageError, SnapshotError, Interrupted
[[nodiscard]] KeyViews suggested_key_views(const RunContext& context, const KeyViewsJob& job, const Engines& engines,
                                           Observer& observer);

/// Says them, and writes key_views.json and key_views.png, their photographs, into the run's folder.
void key_views_step(const RunContext& context, const KeyViewsJob& job, const Engines& engines, Observer& observer);

}  // namespace cnerf::pipeline
