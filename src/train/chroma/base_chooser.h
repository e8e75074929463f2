#pragma once
/// Base patches: what the purification compares the colorizer's answers with (paper: s = 0.7, 5 images).

#include <filesystem>
#include <vector>

#include "src/train/chroma/known_color_map.h"
#include "src/train/chroma/questioner.h"

namespace cnerf {

class BaseChooser {
 public:
  /// Both are referred to.
  BaseChooser(Session& session, Questioner& questioner) : session_(session), questioner_(questioner) {}

  /// Parts of the key frames, at least one of each, whose colours are known; without any, answers of the colorizer,
  /// those that a user picked or the most typical ones. Writes bases.png.
  /// @throws UsageError  see picked
  [[nodiscard]] std::vector<AnsweredPatch> choose(const KnownColorMap& known);

  /// One answer about each place that may become a base.
  [[nodiscard]] std::vector<AnsweredPatch> ask_candidates();

 private:
  [[nodiscard]] std::vector<AnsweredPatch> bases_of_key_frames(const KnownColorMap& known) const;
  [[nodiscard]] std::vector<AnsweredPatch> typical_bases();
  [[nodiscard]] std::vector<AnsweredPatch> answers_about(const std::vector<int>& candidates);
  [[nodiscard]] int candidate_count() const;
  [[nodiscard]] PatchPlace candidate_place(int candidate) const;
  [[nodiscard]] PatchPlace base_patch(std::size_t view, int index) const;
  /// Numbers of candidates.  @throws UsageError  the user picked something else.
  [[nodiscard]] std::vector<int> picked() const;

  Session& session_;
  Questioner& questioner_;
};

}  // namespace cnerf
