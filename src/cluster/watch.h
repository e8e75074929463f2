#pragma once
/// Watches over the processes of a launch: each shows now and then that it lives. Who dies, stops or loses its network
/// is found by the others, each of which ends with an error that names it.

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "src/cluster/channel.h"

namespace cnerf::cluster {

/// How long what may take.
struct Patience {
  Seconds beat{1};      ///< between two signs of life
  Seconds silence{15};  ///< without one, after which a process is lost
  Seconds grace{5};     ///< for the work to end by itself once somebody is lost
};

class Watch {
 public:
  /// Is told, in a thread of its own, that the process has to end now: it did not by itself.
  using End = std::function<void(const std::string& why)>;

  /// @param store  nobody else's
  /// @param names  of all ranks, for messages: "rank 1 (pid 17 on fermi)"
  Watch(std::unique_ptr<Store> store, int rank, std::vector<std::string> names, Patience patience, End end);
  /// Stops watching. The connection may hang: it is given up then.
  ~Watch();
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;

  /// Who was lost, and how; nothing while all is well.
  [[nodiscard]] std::optional<std::string> verdict() const;
  /// @throws RankError  somebody was lost
  void check() const;
  /// What is said of an operation that failed: who was lost, if that turns out soon, else `problem`.
  [[nodiscard]] std::string explained(const std::string& problem) const;
  /// No sign of life is asked of anybody any more: the work is done, or this process has an error of its own.
  void rest();

 private:
  struct State;
  static void beat(const std::shared_ptr<State>& state);
  static void guard(const std::shared_ptr<State>& state);

  std::shared_ptr<State> state_;  // of the threads too, which may outlive this
  std::thread beating_, guarding_;
};

/// Where the verdict about a lost process lies in the store.
inline constexpr const char* kLostKey = "lost";

[[nodiscard]] Bytes bytes_of(const std::string& text);
[[nodiscard]] std::string text_of(const Bytes& bytes);

}  // namespace cnerf::cluster
