#pragma once
/// What a page of the studio is told, and who may change things. The thread that works writes, the server's threads
/// read.

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "src/studio/messages.h"
#include "viewer/server/page_api.h"

namespace cnerf::studio {

/// How often a thread that waits for orders looks whether the user ends the program: Ctrl-C only sets a flag.
inline constexpr auto kPoll = std::chrono::milliseconds(50);

/// Why a task was not done to its end.
struct Setback {
  std::string message;
  bool failed;  ///< or stopped by somebody
};

/// Does the work. An error of any kind ends the work alone: the program may hold colours that are in no file.
/// @return  what kept it from its end, if anything did
/// @param stopped  the message where somebody stopped it
[[nodiscard]] std::optional<Setback> setback_of(const std::function<void()>& work, const std::string& stopped);

/// Nothing is being done any more. A setback is told in the same change: whoever hears of it may order at once.
void end_task(StateMessage& state, const std::optional<Setback>& setback);

/// Versions grow from one board to the next of a process, so that a page hears of the change.
class Board {
 public:
  Board();

  /// Changes the state under the lock, and tells everybody.
  void change(const std::function<void(StateMessage&)>& change);
  void say(const std::string& text);
  /// Adds a line to what the work said lately.
  void note(const std::string& line);

  /// What `look` makes of the state, under the lock.
  template <typename Look>
  auto read(Look&& look) const {
    const std::lock_guard lock(mutex_);
    return look(state_);
  }
  [[nodiscard]] std::string text() const;
  [[nodiscard]] std::optional<std::pair<std::uint64_t, std::string>> wait_for_news(std::uint64_t after, double seconds);

  void joined(const std::string& client);
  void left(const std::string& client);
  /// Whoever orders or paints first is the writer until its stream of news ends.
  /// @return  why another client may not; nothing where it may
  [[nodiscard]] std::optional<web::PageAnswer> become_writer(const std::string& client);

  void close();
  [[nodiscard]] bool closed() const;

 private:
  void changed();

  mutable std::mutex mutex_;
  std::condition_variable news_;
  StateMessage state_;
  std::map<std::string, int> followers_;  // streams of each client
  bool is_closed_ = false;
};

}  // namespace cnerf::studio
