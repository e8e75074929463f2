#pragma once
/// The colours that a studio shows as "now": those of a take, and what strokes made of them.

#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <shared_mutex>
#include <string>
#include <vector>

#include "src/pipeline/run_context.h"
#include "src/studio/known_strokes.h"
#include "src/train/chroma/retouch.h"
#include "src/train/luminance/luminance_model.h"

namespace cnerf::studio {

/// One thing that was done to the colours, so that it can be done again.
struct Deed {
  std::string base;                        ///< the first: the take it began from; empty = grey
  std::vector<Stroke> strokes;             ///< the others: what was painted by then
  int steps = 0;                           ///< and the steps that were run with it
  std::vector<Viewpoint> viewpoints = {};  ///< that the strokes name
  bool everywhere = false;                 ///< as StrokeList has it
  std::string base_sha256 = {};            ///< the first: of that take's snapshot; earlier versions wrote none

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("base", self.base, kOptional);
    v("base_sha256", self.base_sha256, kOptional);
    v("strokes", self.strokes, kOptional);
    v("steps", self.steps, kOptional);
    v("viewpoints", self.viewpoints, kOptional);
    v("everywhere", self.everywhere, kOptional);
  }
};

/// Content of takes/NAME/journal.json: the deeds from a base to the take.
struct Journal {
  std::vector<Deed> deeds;
  std::filesystem::path folder = {};  ///< that it lies in, with the pictures of its strokes; not written

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("deeds", self.deeds);
  }
};

inline constexpr const char* kJournalFile = "journal.json";
inline constexpr const char* kNowFile = "now.json";  ///< of a run's strokes: the journal of what no take holds
/// A take's journal of any content.
/// @param views  that strokes may name
/// @throws MissingInputError, InputError  "file: deeds[2].strokes…"
[[nodiscard]] Journal read_journal(const std::filesystem::path& file, const PaintableViews& views);
/// @throws OutputError
void write_journal(const std::filesystem::path& file, const Journal& journal);

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
  /// What made "now".
  [[nodiscard]] const Journal& journal() const { return journal_; }

  /// Traces the training views, once.
  void cache_views(const Breathe& breathe);
  /// What is traced of them, for others who colour this run. Without viewpoints in their job, they colour by the
  /// capture's views alone.
  [[nodiscard]] ViewCache& cached_views() { return cache_; }

  // What is traced changes on one thread, which works and looks at it without a lock. Others hold `reading()` while
  // they look. Viewpoints come beside work that goes on: they take places that nobody works with, and nothing moves for
  // them. They go, or move, only between two pieces of work.

  /// Traces viewpoints, each once. After `cache_views`, on the thread that works.
  /// @param breathe  may be none
  void see(std::span<const Viewpoint> viewpoints, const Breathe& breathe);
  /// Lets what was traced of other viewpoints go. Between two pieces of work.
  void forget_others(std::span<const Viewpoint> viewpoints);

  [[nodiscard]] std::shared_lock<std::shared_mutex> reading() const { return std::shared_lock(seen_mutex_); }
  /// Of the views, then of viewpoints. Null until they are traced.
  [[nodiscard]] const SeenSurfaces* seen() const { return seen_ ? &*seen_ : nullptr; }
  [[nodiscard]] bool has_seen(std::span<const Viewpoint> viewpoints) const;
  /// What a list makes known of them. It is kept for whoever asks for that list again, until something moves.
  [[nodiscard]] std::shared_ptr<const KnownStrokes> known(const StrokeList& list) const;

  /// "Now" becomes what a take has; empty = grey.  @throws as ColorModel::load
  void begin(const std::string& take);
  /// Goes on with "now" until it has settled on the strokes. What was learned when `breathe` throws stays.
  /// @param most_steps  to stop after
  void colour(const StrokeList& list, const RetouchOptions& options, const Breathe& breathe,
              int most_steps = std::numeric_limits<int>::max());
  /// Writes "now" as a take, with all that its journal needs.
  /// @throws OutputError, BusyError, UsageError  there is one and it is not to be overwritten
  void keep(const std::string& take, double seconds, Observer& observer, bool overwrite = false);
  /// Does what a journal says, from its base on.
  /// @throws SnapshotError  another take has its base's name by now; and as `begin` and `colour`
  void replay(const Journal& journal, const RetouchOptions& options, const Breathe& breathe);

 private:
  void change_seen(const std::function<void()>& change);

  const pipeline::RunContext& context_;
  const Engines& engines_;
  LuminanceModel luminance_;
  std::string stage1_sha256_;
  mutable std::shared_mutex seen_mutex_;  // of the two that follow
  ViewCache cache_;
  std::optional<SeenSurfaces> seen_;
  mutable std::mutex known_mutex_;
  mutable std::shared_ptr<const KnownStrokes> known_;  // of the list that was asked for last
  std::unique_ptr<ColorModel> base_, now_;             // no base: grey
  std::string base_name_, kept_as_;
  bool is_grey_ = true, is_unkept_ = false;
  Journal journal_;
};

}  // namespace cnerf::studio
