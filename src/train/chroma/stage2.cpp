#include "src/train/chroma/stage2.h"

#include <algorithm>

#include "src/base/error.h"
#include "src/colorizer/purify.h"
#include "src/train/chroma/base_chooser.h"
#include "src/train/chroma/distillation.h"
#include "src/train/chroma/galleries.h"
#include "src/train/chroma/injection.h"

namespace cnerf {
namespace {

Purifier purifier_of(const PurifyOptions& options, const std::vector<AnsweredPatch>& bases) {
  std::vector<ColorPatchView> views;
  for (const AnsweredPatch& base : bases) views.push_back(base.view());
  return {options, views};
}

Stage2Report colorize(Session& session, const KnownColorMap& known, Questions& questions, const Injection& injection) {
  Questioner questioner(session, questions);
  const Purifier purifier = purifier_of(session.options.purify, BaseChooser(session, questioner).choose(known));
  PatchTraining(session, injection, questioner, purifier, known).run();
  if (injection.pixel_colors() == PixelColors::kDistribution) distill(session);
  session.model.report.bake_ab_distance = bake_ab_distance(session);
  session.save();
  return session.model.report;
}

}  // namespace

void check_bases(const PurifyOptions& options, std::span<const KnownColors> known) {
  const bool has_key_frame =
      std::ranges::any_of(known, [](const KnownColors& of_view) { return of_view.kind == KnownColorKind::kKeyFrame; });
  if (options.picked_bases.empty() || !has_key_frame) return;
  throw UsageError(
      "stage2.purify.picked_bases (--bases): key frames are the bases where there are any; give one or the other");
}

Stage2Report train_stage2(const Stage2Job& job, const Engines& engines, Observer& observer) {
  PatchQuestions patches;
  const Classification classification(job.options);
  const Injection& injection = job.injection != nullptr ? *job.injection : classification;
  Session session(job, observer);
  session.start_or_resume(engines, injection.pixel_colors());
  session.cache_views(engines);
  const KnownColorMap known = known_color_map(session.views(), session.names(), job.known);
  return colorize(session, known, job.questions != nullptr ? *job.questions : patches, injection);
}

std::vector<Tile> base_candidates(const Stage2Job& job, const Engines& engines, Observer& observer) {
  PatchQuestions questions;
  Session session(job, observer);
  session.cache_views(engines);
  Questioner questioner(session, questions);
  return candidate_tiles(BaseChooser(session, questioner).ask_candidates());
}

}  // namespace cnerf
