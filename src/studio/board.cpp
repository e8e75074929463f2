#include "src/studio/board.h"

#include <atomic>
#include <chrono>
#include <exception>
#include <filesystem>
#include <new>

#include "src/base/error.h"

namespace cnerf::studio {
namespace {

constexpr std::size_t kMostNotes = 12;

/// Names of files need not be in UTF-8.
std::string text_of(const StateMessage& state) {
  return json_of(state).dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

std::uint64_t next_version() {
  static std::atomic<std::uint64_t> version = 0;
  return ++version;
}

}  // namespace

std::optional<Setback> setback_of(const std::function<void()>& work, const std::string& stopped) {
  try {
    work();
    return std::nullopt;
  } catch (const Interrupted&) {
    return Setback{stopped, false};
  } catch (const Error& problem) {
    return Setback{problem.what(), true};
  } catch (const std::bad_alloc&) {
    return Setback{"the memory does not suffice for this", true};
  } catch (const std::filesystem::filesystem_error& problem) {
    return Setback{problem.path1().string() + ": " + problem.code().message(), true};
  } catch (const std::exception& problem) {
    return Setback{std::string("internal error, please report it: ") + problem.what(), true};
  }
}

void end_task(StateMessage& state, const std::optional<Setback>& setback) {
  state.task.clear();
  state.step.clear();
  state.fraction = 0;
  if (!setback) return;
  state.message = setback->message;
  state.failed = setback->failed;
}

Board::Board() {
  state_.version = next_version();
}

/// Under the lock.
void Board::changed() {
  state_.version = next_version();
  news_.notify_all();
}

void Board::change(const std::function<void(StateMessage&)>& change) {
  const std::lock_guard lock(mutex_);
  change(state_);
  changed();
}

void Board::say(const std::string& text) {
  change([&](StateMessage& state) {
    state.message = text;
    state.failed = false;
  });
}

void Board::note(const std::string& line) {
  change([&](StateMessage& state) {
    if (state.notes.size() >= kMostNotes) state.notes.erase(state.notes.begin());
    state.notes.push_back(line);
  });
}

std::string Board::text() const {
  return read(text_of);
}

std::optional<std::pair<std::uint64_t, std::string>> Board::wait_for_news(std::uint64_t after, double seconds) {
  std::unique_lock lock(mutex_);
  const auto has_news = [&] { return state_.version != after || is_closed_; };
  if (!news_.wait_for(lock, std::chrono::duration<double>(seconds), has_news) || state_.version == after) {
    return std::nullopt;
  }
  return std::pair{state_.version, text_of(state_)};
}

void Board::joined(const std::string& client) {
  const std::lock_guard lock(mutex_);
  ++followers_[client];
}

void Board::left(const std::string& client) {
  const std::lock_guard lock(mutex_);
  if (--followers_[client] > 0) return;
  followers_.erase(client);
  if (state_.writer != client) return;
  state_.writer.clear();
  changed();
}

/// Only who listens can be noticed when it leaves: others may change things, but never own the studio.
std::optional<web::PageAnswer> Board::become_writer(const std::string& client) {
  const std::lock_guard lock(mutex_);
  if (!state_.writer.empty() && state_.writer != client) return web::refusal(423, "another tab paints");
  if (followers_.contains(client) && state_.writer != client) {
    state_.writer = client;
    changed();
  }
  return std::nullopt;
}

void Board::close() {
  const std::lock_guard lock(mutex_);
  is_closed_ = true;
  news_.notify_all();
}

bool Board::closed() const {
  const std::lock_guard lock(mutex_);
  return is_closed_;
}

}  // namespace cnerf::studio
