#pragma once
/// The colours that a studio shows as "now": those of a take, and what strokes made of them.

#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "src/pipeline/run_context.h"
#include "src/train/chroma/known_color_map.h"
#include "src/train/chroma/retouch.h"
#include "src/train/chroma/strokes.h"
#include "src/train/luminance/luminance_model.h"

namespace cnerf::studio {

/// One thing that was done to the colours, so that it can be done again.
struct Deed {
  std::string base;             ///< the first: the take it began from; empty = grey
  std::vector<Stroke> strokes;  ///< the others: what was painted by then
  int steps = 0;                ///< and the steps that were run with it

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("base", self.base, kOptional);
    v("strokes", self.strokes, kOptional);
    v("steps", self.steps, kOptional);
  }
};

/// Content of takes/NAME/journal.json: the deeds from a base to the take.
struct Journal {
  std::vector<Deed> deeds;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("deeds", self.deeds);
  }
};

inline constexpr const char* kJournalFile = "journal.json";
/// A take's journal of any content.
/// @param views  names that strokes may have
/// @throws MissingInputError, InputError  "file: deeds[2].strokes…"
[[nodiscard]] Journal read_journal(const std::filesystem::path& file, std::span<const std::string> views);

/// Called between pieces of work, with the share that is done; may throw Interrupted.
using Breathe = std::function<void(double fraction)>;

class Coloring {
 public:
  /// Loads stage 1.  Refers to both.
  Coloring(const pipeline::RunContext& context, const Engines& engines);

  [[nodiscard]] const LuminanceModel& luminance() const { return luminance_; }
  /// What "now" draws with; null while it is grey.
  [[nodiscard]] const ColorModel* now() const { return is_grey_ ? nullptr : now_.get(); }
  /// The take that "now" began from; empty = grey.
  [[nodiscard]] const std::string& base_name() const { return base_name_; }
  /// The take that holds what "now" is; empty = grey, or in none.
  [[nodiscard]] const std::string& kept_as() const { return kept_as_; }
  /// A take was given another name; an empty one: it is gone.
  void take_is_called(const std::string& take, const std::string& name);
  [[nodiscard]] bool is_unkept() const { return is_unkept_; }

  /// Traces the training views, once.
  void cache_views(const Breathe& breathe);
  /// What is traced of them, for others who colour this run.
  [[nodiscard]] ViewCache& cached_views() { return cache_; }
  /// Null until then. Does not change any more.
  [[nodiscard]] const SeenSurfaces* seen() const { return seen_ ? &*seen_ : nullptr; }
  [[nodiscard]] std::span<const std::string> names() const { return cache_.names(); }

  /// "Now" becomes what a take has; empty = grey.  @throws as ColorModel::load
  void begin(const std::string& take);
  /// Goes on with "now" until it has settled on the strokes. What was learned when `breathe` throws stays.
  /// @param most_steps  to stop after
  void colour(const std::vector<Stroke>& strokes, const RetouchOptions& options, const Breathe& breathe,
              int most_steps = std::numeric_limits<int>::max());
  /// Writes "now" as a take.  @throws OutputError, BusyError
  void keep(const std::string& take, double seconds, Observer& observer);
  /// Does what a journal says, from its base on.
  void replay(const Journal& journal, const RetouchOptions& options, const Breathe& breathe);

 private:
  const pipeline::RunContext& context_;
  const Engines& engines_;
  LuminanceModel luminance_;
  std::string stage1_sha256_;
  ViewCache cache_;
  std::optional<SeenSurfaces> seen_;
  std::unique_ptr<ColorModel> base_, now_;  // no base: grey
  std::string base_name_, kept_as_;
  bool is_grey_ = true, is_unkept_ = false;
  Journal journal_;
};

/// What the strokes of a list make known, at the sizes of cached views.
[[nodiscard]] std::vector<KnownColors> known_of(const std::vector<Stroke>& strokes, std::span<const CachedView> views,
                                                std::span<const std::string> names);

}  // namespace cnerf::studio
