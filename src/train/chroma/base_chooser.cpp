#include "src/train/chroma/base_chooser.h"

#include <algorithm>
#include <sstream>

#include "src/base/error.h"
#include "src/base/text.h"
#include "src/colorizer/purify.h"
#include "src/picture/encode.h"
#include "src/train/chroma/galleries.h"

namespace cnerf {
namespace {

constexpr int kCandidates = 12;
constexpr double kBaseScale = 0.7;  // s of base patches
// Patch indices of bases and of opinions about them, apart from training's.
constexpr std::uint64_t kFirstBaseIndex = std::uint64_t(1) << 32, kFirstOpinionIndex = std::uint64_t(1) << 33;

}  // namespace

std::vector<AnsweredPatch> BaseChooser::choose(const KnownColorMap& known) {
  const PurifyOptions& purify = session_.options.purify;
  const bool is_picked = !purify.picked_bases.empty(), has_key_frames = !known.key_frames().empty();
  if (!has_key_frames && purify.enabled && !is_picked && purify.opinions > 1) return typical_bases();
  const std::vector<AnsweredPatch> candidates = has_key_frames ? bases_of_key_frames(known) : ask_candidates();
  if (session_.ranks().is_first()) write_png(session_.folder() / "bases.png", tiled(candidate_tiles(candidates)));
  if (has_key_frames) return candidates;
  std::vector<AnsweredPatch> bases;
  for (const int index : picked()) bases.push_back(candidates[std::size_t(index)]);
  return bases;
}

std::vector<AnsweredPatch> BaseChooser::ask_candidates() {
  std::vector<PatchPlace> places;
  for (int i = 0; i < candidate_count(); ++i) places.push_back(candidate_place(i));
  return questioner_.ask_all(places);
}

std::vector<AnsweredPatch> BaseChooser::bases_of_key_frames(const KnownColorMap& known) const {
  std::vector<AnsweredPatch> bases;
  const auto frames = known.key_frames();
  const int k = session_.options.patch_size;
  const int count = std::max(session_.options.purify.base_images, int(frames.size()));
  for (int i = 0; i < count; ++i) {
    const KnownColorMap::KeyFrame& frame = frames[std::size_t(i) % frames.size()];
    const PatchPlace place = base_patch(frame.view, i);
    const CachedView& view = session_.views()[frame.view];
    bases.push_back({place, k, render_patch(view, place, k), patch_colors(view, place, k, frame.ab)});
  }
  return bases;
}

/// Where nobody picks: the most typical of all answers about all places says what the colours are, and of each place
/// the answer most like that one is its base. So places cannot disagree with each other.
std::vector<AnsweredPatch> BaseChooser::typical_bases() {
  const std::vector<AnsweredPatch> answered = answers_about(picked());
  std::vector<ColorPatchView> views;
  for (const AnsweredPatch& answer : answered) views.push_back(answer.view());
  const PurifyOptions& purify = session_.options.purify;
  const Purifier like_it(purify, std::span(views).subspan(most_typical(views), 1));
  const auto likeness = [&](const AnsweredPatch& answer) { return like_it.similarity(answer.view()); };
  std::vector<AnsweredPatch> bases;
  std::vector<Tile> tiles;
  for (auto of_place = answered.begin(); of_place != answered.end(); of_place += purify.opinions) {
    bases.push_back(*std::ranges::max_element(of_place, of_place + purify.opinions, {}, likeness));
    tiles.push_back(tile_of(bases.back(), "of " + std::to_string(purify.opinions)));
  }
  if (session_.ranks().is_first()) write_png(session_.folder() / "bases.png", tiled(tiles));
  return bases;
}

/// As many as the options want opinions about each place, slightly moved.
std::vector<AnsweredPatch> BaseChooser::answers_about(const std::vector<int>& candidates) {
  const auto seed = std::uint64_t(session_.options.seed);
  std::vector<PatchPlace> asked;
  for (const int candidate : candidates) {
    const PatchPlace place = candidate_place(candidate);
    asked.push_back(place);
    for (int i = 1; i < session_.options.purify.opinions; ++i) {
      asked.push_back(near_patch(session_.views(), place, seed, kFirstOpinionIndex + asked.size()));
    }
  }
  return questioner_.ask_all(asked);
}

int BaseChooser::candidate_count() const {
  return std::max(kCandidates, session_.options.purify.base_images);
}

/// Spread evenly over the views, so that they cover a 360 capture's directions.
PatchPlace BaseChooser::candidate_place(int candidate) const {
  return base_patch(std::size_t(candidate) * session_.views().size() / std::size_t(candidate_count()), candidate);
}

PatchPlace BaseChooser::base_patch(std::size_t view, int index) const {
  return random_patch(session_.views(), view, {kBaseScale, kBaseScale}, std::uint64_t(session_.options.seed),
                      kFirstBaseIndex + std::uint64_t(index));
}

std::vector<int> BaseChooser::picked() const {
  const PurifyOptions& purify = session_.options.purify;
  const int candidates = candidate_count();
  std::vector<int> picked;
  if (purify.picked_bases.empty()) {
    for (int i = 0; i < purify.base_images; ++i) picked.push_back(i * candidates / purify.base_images);
    return picked;
  }
  std::stringstream list(purify.picked_bases);
  for (std::string item; std::getline(list, item, ',');) {
    const auto index = item.size() < 6 ? value_in<unsigned>(item) : std::nullopt;
    if (!index || int(*index) >= candidates) {
      throw UsageError("stage2.purify.picked_bases: '" + item + "' is not a candidate, 0 to " +
                       std::to_string(candidates - 1));
    }
    picked.push_back(int(*index));
  }
  return picked;
}

}  // namespace cnerf
