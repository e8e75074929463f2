#pragma once
/// Questioner: shows patches to the colorizer, some of them ahead of their use.

#include <future>
#include <span>
#include <utility>
#include <vector>

#include "src/base/worker.h"
#include "src/train/chroma/patches.h"
#include "src/train/chroma/session.h"

namespace cnerf {

/// Finds out the colours of patches. An extension point: the comparison has another one.
class Questions {
 public:
  virtual ~Questions() = default;
  /// Is called once, before the first question, with the views that there are to ask about.
  virtual void prepare(Session& /*session*/) {}
  /// One query. Is always called from the same thread.
  /// @param patches  have no colours yet
  virtual void answer(const Session& session, std::span<AnsweredPatch> patches) = 0;
};

/// The method's own: the colorizer is asked about each patch.
class PatchQuestions final : public Questions {
 public:
  void answer(const Session& session, std::span<AnsweredPatch> patches) override;
};

/// The answer to one query.
struct Answers {
  std::vector<AnsweredPatch> patches;
  double seconds = 0;  ///< that rendering and colouring them took
};

class Questioner {
 public:
  /// Both are referred to.
  Questioner(Session& session, Questions& questions);

  /// Asks about places in queries of the options' size, one after another.
  [[nodiscard]] std::vector<AnsweredPatch> ask_all(const std::vector<PatchPlace>& places);

  /// The colorizer answers about `count` patches of numbers `first`, `first` + 1, … while others are trained on. One
  /// query is under way at a time; which patches it shows depends on their numbers alone.
  void ask_ahead(std::int64_t first, int count);
  /// Waits for what was asked ahead.
  [[nodiscard]] Answers next();

 private:
  /// Of the places, this rank's part has answers then.
  [[nodiscard]] Answers ask(std::span<const PatchPlace> places) const;
  /// Which of so many patches this rank asks about: the first one and the one behind the last.
  [[nodiscard]] std::pair<std::size_t, std::size_t> part_of(std::size_t patches, int rank) const;
  /// Gives all ranks the answers that each of them has.
  void exchange(std::vector<AnsweredPatch>& patches) const;

  Session& session_;
  Questions& questions_;
  std::future<Answers> coming_;
  Worker worker_;  // last: its job refers to what is above
};

}  // namespace cnerf
