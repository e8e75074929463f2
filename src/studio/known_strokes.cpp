#include "src/studio/known_strokes.h"

#include <utility>

#include "src/base/check.h"
#include "src/base/parallel.h"

namespace cnerf::studio {
namespace {

std::string text_of(const StrokeList& list) {
  StrokeList unnumbered = list;
  unnumbered.revision = 0;
  return json_of(unnumbered).dump();
}

}  // namespace

std::vector<KnownColors> known_of(const StrokeList& list, const SeenSurfaces& seen) {
  std::vector<Intrinsics> lenses;
  for (const CachedView& view : seen.views()) lenses.push_back(view.camera.intrinsics);
  return painted(list, seen.names(), lenses);
}

KnownStrokes::KnownStrokes(const StrokeList& list, const SeenSurfaces& seen)
    : seen_(seen), list_(text_of(list)), painted_(known_of(list, seen)), views_(seen.views().size()) {}

bool KnownStrokes::is_of(const StrokeList& list) const {
  return list_ == text_of(list);
}

KnownColorMap::OfView KnownStrokes::in(std::size_t view) const {
  CNERF_CHECK(view < views_.size(), "a view that was seen when the strokes were");
  spread();
  View& wanted = views_[view];
  std::call_once(wanted.is_seen,
                 [&] { wanted.colors = std::make_shared<const RunningColors>(sources_->seen_in(view)); });
  return wanted.colors;
}

void KnownStrokes::spread() const {
  std::call_once(are_spread_, [&] { sources_.emplace(seen_, painted_); });
}

KnownColorMap KnownStrokes::map(std::size_t views) const {
  spread();  // by all threads: in the loop, all but one would wait for it
  std::vector<KnownColorMap::OfView> colors(painted_.empty() ? 0 : views);
  parallel_tasks(colors.size(), [&](std::size_t v) { colors[v] = in(v); });
  return KnownColorMap(std::move(colors));
}

}  // namespace cnerf::studio
