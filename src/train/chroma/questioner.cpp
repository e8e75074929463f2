#include "src/train/chroma/questioner.h"

#include <algorithm>
#include <iterator>

#include "src/base/parallel.h"
#include "src/base/rng.h"
#include "src/base/usage.h"
#include "src/cluster/packing.h"

namespace cnerf {
namespace {

// s of the training's patches (paper, Eq. patch sampling). The largest show whole things and their surroundings, from
// which a colorizer knows what they are.
constexpr double kSmallestPatch = 0.3, kLargestPatch = 1;

}  // namespace

void PatchQuestions::answer(const Session& session, std::span<AnsweredPatch> patches) {
  const int k = session.options.patch_size;
  LightnessBatch question{int(patches.size()), k, k, {}, {}};
  for (const AnsweredPatch& patch : patches) {
    const PatchPlace& place = patch.place;
    const CachedView& view = session.views()[place.view];
    const std::vector<float>& lightness = patch.shown.lightness;
    question.lightness.insert(question.lightness.end(), lightness.begin(), lightness.end());
    const double w = view.width, h = view.height;
    question.origins.push_back(
        {session.names()[place.view], place.left / w, place.top / h, place.side / w, place.side / h, place.index});
  }
  const ChromaBatch answer = session.colorizer.colorize(question);
  check_answer(session.colorizer.name(), question, answer);
  parallel_tasks(patches.size(), [&](std::size_t i) {
    patches[i].ab = ab_of(answer, int(i));
    if (session.options.sure_colors > 0) patches[i].certainty = certainty_of(answer, int(i));
  });
}

Questioner::Questioner(Session& session, Questions& questions) : session_(session), questions_(questions) {
  questions_.prepare(session_);
}

Answers Questioner::ask(std::span<const PatchPlace> places) const {
  const Stopwatch watch;
  Answers answers;
  const int k = session_.options.patch_size;
  answers.patches.resize(places.size());
  parallel_tasks(places.size(), [&](std::size_t i) {
    answers.patches[i] = {places[i], k, render_patch(session_.views()[places[i].view], places[i], k), {}};
  });
  const auto [first, last] = part_of(places.size(), session_.ranks().rank());
  if (first < last) questions_.answer(session_, std::span(answers.patches).subspan(first, last - first));
  answers.seconds = watch.seconds();
  return answers;
}

std::pair<std::size_t, std::size_t> Questioner::part_of(std::size_t patches, int rank) const {
  const auto ranks = std::size_t(session_.ranks().size()), part = std::size_t(rank);
  return {patches * part / ranks, patches * (part + 1) / ranks};
}

void Questioner::exchange(std::vector<AnsweredPatch>& patches) const {
  cluster::Ranks& ranks = session_.ranks();
  if (ranks.is_alone()) return;
  cluster::Packer own;
  const auto [first, last] = part_of(patches.size(), ranks.rank());
  for (std::size_t i = first; i < last; ++i) {
    own.add(patches[i].ab);
    own.add(patches[i].certainty);
  }
  const std::vector<cluster::Bytes> all = ranks.gather(own.packed());
  for (int rank = 0; rank < ranks.size(); ++rank) {
    cluster::Unpacker answers(all[std::size_t(rank)]);
    const auto [begin, end] = part_of(patches.size(), rank);
    for (std::size_t i = begin; i < end; ++i) {
      answers.get(patches[i].ab);
      answers.get(patches[i].certainty);
    }
  }
}

Answers Questioner::next() {
  Answers answers = coming_.get();
  exchange(answers.patches);
  return answers;
}

std::vector<AnsweredPatch> Questioner::ask_all(const std::vector<PatchPlace>& places) {
  const auto batch = std::size_t(session_.options.colorizer_batch);
  std::vector<AnsweredPatch> answered;
  for (std::size_t first = 0; first < places.size(); first += batch) {
    const auto query = std::span(places).subspan(first, std::min(batch, places.size() - first));
    Answers answers = worker_.submit([&] { return ask(query); }).get();
    exchange(answers.patches);
    session_.model.report.colorizer_seconds += answers.seconds;
    std::ranges::move(answers.patches, std::back_inserter(answered));
  }
  return answered;
}

void Questioner::ask_ahead(std::int64_t first, int count) {
  coming_ = worker_.submit([this, first, count] {
    const auto seed = std::uint64_t(session_.options.seed);
    std::vector<PatchPlace> places;
    for (int i = 0; i < count; ++i) {
      const auto index = std::uint64_t(first + i);
      const CounterRng rng(seed, index);
      const std::size_t view = rng.below(0, std::uint32_t(session_.views().size()));
      places.push_back(random_patch(session_.views(), view, {kSmallestPatch, kLargestPatch}, seed, index));
    }
    return ask(places);
  });
}

}  // namespace cnerf
