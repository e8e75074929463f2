#include "src/cluster/watch.h"

#include <fmt/format.h>

#include <algorithm>

#include "src/base/error.h"

namespace cnerf::cluster {
namespace {

using Clock = std::chrono::steady_clock;

std::string beat_key(int rank) {
  return "beat/" + std::to_string(rank);
}

}  // namespace

Bytes bytes_of(const std::string& text) {
  const auto* begin = reinterpret_cast<const std::byte*>(text.data());
  return {begin, begin + text.size()};
}

std::string text_of(const Bytes& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

struct Watch::State {
  std::unique_ptr<Store> store;
  int rank;
  std::vector<std::string> names;
  Patience patience;
  End end;

  std::mutex mutex;
  std::condition_variable changed;
  std::optional<std::string> verdict;
  Clock::time_point last_answer = Clock::now();  // of the store
  bool rests = false;

  /// The first one counts.
  void decide(const std::string& why) {
    const std::lock_guard lock(mutex);
    if (!verdict && !rests) verdict = why;
    changed.notify_all();
  }
  /// Sleeps, unless it is told to rest.  @return  whether it is
  bool rests_after(Seconds time) {
    std::unique_lock lock(mutex);
    return changed.wait_for(lock, time, [&] { return rests; });
  }
  /// Of rank 0 all the others, of the others rank 0: what it finds stands in the store for all.
  [[nodiscard]] std::vector<int> watched() const {
    std::vector<int> ranks;
    for (int other = 1; other < int(names.size()) && rank == 0; ++other) ranks.push_back(other);
    if (rank != 0) ranks.push_back(0);
    return ranks;
  }
};

Watch::Watch(std::unique_ptr<Store> store, int rank, std::vector<std::string> names, Patience patience, End end)
    : state_(std::make_shared<State>()) {
  state_->store = std::move(store);
  state_->rank = rank;
  state_->names = std::move(names);
  state_->patience = patience;
  state_->end = std::move(end);
  beating_ = std::thread(beat, state_);
  guarding_ = std::thread(guard, state_);
}

Watch::~Watch() {
  rest();
  guarding_.join();
  beating_.detach();  // it may hang in the network
}

void Watch::beat(const std::shared_ptr<State>& state) {
  struct Sight {
    std::int64_t beats = 0;
    Clock::time_point changed = Clock::now();
  };
  const std::vector<int> watched = state->watched();
  std::vector<Sight> seen(watched.size());
  try {
    do {
      state->store->add(beat_key(state->rank), 1);
      if (const auto lost = state->store->get(kLostKey)) return state->decide(text_of(*lost));
      for (std::size_t i = 0; i < watched.size(); ++i) {
        const std::int64_t beats = state->store->add(beat_key(watched[i]), 0);
        const Clock::time_point now = Clock::now();
        if (beats != seen[i].beats) seen[i] = {beats, now};
        if (now - seen[i].changed < state->patience.silence) continue;
        const std::string why = fmt::format("{} has shown no sign of life for {:.0f} s",
                                            state->names[std::size_t(watched[i])], state->patience.silence.count());
        if (state->rank == 0) state->store->set(kLostKey, bytes_of(why));
        return state->decide(why);
      }
      const std::lock_guard lock(state->mutex);
      state->last_answer = Clock::now();
    } while (!state->rests_after(state->patience.beat));
  } catch (const std::exception&) {
    state->decide(state->names.front() + " is gone, and with it the store of all processes");
  }
}

void Watch::guard(const std::shared_ptr<State>& state) {
  const Seconds glance = std::min(state->patience.beat, Seconds(0.2));
  while (!state->rests_after(glance)) {
    std::optional<std::string> verdict;
    bool is_silent = false;
    {
      const std::lock_guard lock(state->mutex);
      verdict = state->verdict;
      is_silent = Clock::now() - state->last_answer > state->patience.silence;
    }
    if (!verdict && is_silent) {
      state->decide(fmt::format("{} cannot be reached: no answer for {:.0f} s", state->names.front(),
                                state->patience.silence.count()));
      continue;
    }
    if (!verdict) continue;
    if (!state->rests_after(state->patience.grace)) state->end(*verdict);
    return;
  }
}

std::optional<std::string> Watch::verdict() const {
  const std::lock_guard lock(state_->mutex);
  return state_->verdict;
}

void Watch::check() const {
  if (const auto why = verdict()) throw RankError(*why);
}

std::string Watch::explained(const std::string& problem) const {
  std::unique_lock lock(state_->mutex);
  const Seconds soon = state_->patience.silence + 3 * state_->patience.beat;
  state_->changed.wait_for(lock, soon, [&] { return state_->verdict.has_value(); });
  return state_->verdict.value_or("the processes lost each other: " + problem);
}

void Watch::rest() {
  const std::lock_guard lock(state_->mutex);
  state_->rests = true;
  state_->changed.notify_all();
}

}  // namespace cnerf::cluster
