#pragma once
/// cpp-httplib's server, and what it lacks against clients that are slow or many.

#include <httplib.h>

#include <chrono>
#include <cstddef>
#include <list>
#include <mutex>
#include <optional>
#include <string>

namespace cnerf::web {

/// How much of a server its clients may take.
struct ConnectionLimits {
  int connections = 40;               ///< each has a thread
  int connections_of_address = 24;    ///< of these
  std::chrono::seconds request{10};   ///< from the first byte of a request to its last, if it is small
  std::size_t least_rate = 16384;     ///< bytes per second that a large one comes in: it gets the time for them besides
  std::chrono::seconds idle{5};       ///< between two requests
  std::chrono::seconds stalled{30};   ///< of an answer that nobody takes, or of news without a receipt
  std::size_t request_bytes = 65536;  ///< of a request, head and body
};

/// The open connections. When there are too many, the one goes whose client keeps us waiting longest: slow ones cannot
/// keep others out. Those whose word lies there unread go last, and only for one that came after it.
class Connections {
 public:
  using Clock = std::chrono::steady_clock;
  /// For a client, as poll() names it.
  struct Wait {
    Clock::time_point since;
    short events;
  };
  struct Entry {
    socket_t socket;
    std::string address;
    Clock::time_point arrived;
    std::optional<Wait> waiting;
    bool is_leaving = false;
  };
  using Handle = std::list<Entry>::iterator;

  explicit Connections(const ConnectionLimits& limits) : limits_(limits) {}

  /// Of a connection that waits for a thread: makes one free if need be.
  /// @return  when it arrived, which is now
  Clock::time_point expect();
  /// Of one that has got its thread.  @return  false where its address has too many, all of them at work
  bool admit(Handle handle);
  /// It is waited for at once: a busy machine's threads are slow to ask for its request.
  Handle add(socket_t socket, std::string address, Clock::time_point arrived);
  void remove(Handle handle);
  void set_waiting(Handle handle, std::optional<Wait> waiting);
  /// No client is waited for any more.
  void end();

 private:
  template <typename Belongs>
  bool drop_slowest(Clock::time_point arrival_of_next, const Belongs& belongs);

  ConnectionLimits limits_;
  std::mutex mutex_;
  std::list<Entry> entries_;
  int expected_ = 0;
  bool has_ended_ = false;
};

class HttpServer : public httplib::Server {
 public:
  explicit HttpServer(const ConnectionLimits& limits = {});
  /// Lets more clients queue for a connection than the library's 5, whose next ones would wait a second. Once it is
  /// bound.
  void widen_queue();
  /// Ends it without waiting for clients. An answer of 400 or more is a connection's last.
  void end();

 private:
  class Connection;
  bool process_and_close_socket(socket_t socket) override;

  ConnectionLimits limits_;
  Connections connections_;
};

}  // namespace cnerf::web
