#include "viewer/server/http_server.h"

#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <string_view>
#include <tuple>
#include <utility>

namespace cnerf::web {
namespace {

using Clock = Connections::Clock;

/// When the connection of this thread was accepted.
thread_local Clock::time_point arrival;

/// Whether a task was taken, or nothing in earlier versions of the library.
using Accepted = decltype(std::declval<httplib::TaskQueue&>().enqueue({}));

/// The library's threads, told of each connection before it waits for one of them.
class Workers final : public httplib::TaskQueue {
 public:
  Workers(Connections& connections, int threads) : connections_(connections), pool_(std::size_t(threads)) {}
  Accepted enqueue(std::function<void()> work) override {
    return pool_.enqueue([arrived = connections_.expect(), work = std::move(work)] {
      arrival = arrived;
      work();
    });
  }
  void shutdown() override { pool_.shutdown(); }

 private:
  Connections& connections_;
  httplib::ThreadPool pool_;
};

std::pair<std::string, int> address_of(const sockaddr_storage& address, socklen_t size) {
  char host[NI_MAXHOST] = "", port[NI_MAXSERV] = "0";
  ::getnameinfo(reinterpret_cast<const sockaddr*>(&address), size, host, sizeof host, port, sizeof port,
                NI_NUMERICHOST | NI_NUMERICSERV);
  return {host, std::atoi(port)};
}

std::pair<std::string, int> peer_of(socket_t socket) {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  return ::getpeername(socket, reinterpret_cast<sockaddr*>(&address), &size) == 0 ? address_of(address, size)
                                                                                  : std::pair<std::string, int>{};
}

/// Whether what was waited for has come: the connection's thread has yet to wake up.
bool has_come(socket_t socket, const Connections::Wait& waiting) {
  pollfd now{socket, waiting.events, 0};
  return ::poll(&now, 1, 0) > 0;
}

/// Whether the answer that this thread gave is its connection's last.
thread_local bool is_last_answer = false;

}  // namespace

// ---- which connections there are ----------------------------------------------------------------------------------

template <typename Belongs>
bool Connections::drop_slowest(Clock::time_point arrival_of_next, const Belongs& belongs) {
  Entry* slowest = nullptr;
  std::pair<bool, Clock::time_point> rank_of_slowest;
  for (Entry& entry : entries_) {
    if (entry.is_leaving || !entry.waiting || !belongs(entry)) continue;
    const std::pair rank(has_come(entry.socket, *entry.waiting), entry.waiting->since);
    if (rank.first && rank.second >= arrival_of_next) continue;  // it is our threads that are late
    if (slowest != nullptr && rank_of_slowest <= rank) continue;
    slowest = &entry;
    rank_of_slowest = rank;
  }
  if (slowest == nullptr) return false;
  slowest->is_leaving = true;
  ::shutdown(slowest->socket, SHUT_RDWR);  // its thread wakes up and closes it
  return true;
}

Clock::time_point Connections::expect() {
  const std::lock_guard guard(mutex_);
  const auto now = Clock::now();
  ++expected_;
  const auto staying = std::ranges::count(entries_, false, &Entry::is_leaving);
  if (staying + expected_ > limits_.connections) (void)drop_slowest(now, [](const Entry&) { return true; });
  return now;
}

Connections::Handle Connections::add(socket_t socket, std::string address, Clock::time_point arrived) {
  const std::lock_guard guard(mutex_);
  --expected_;
  return entries_.insert(entries_.end(), {socket, std::move(address), arrived, Wait{arrived, POLLIN}});
}

bool Connections::admit(Handle handle) {
  const std::lock_guard guard(mutex_);
  const auto is_neighbour = [&](const Entry& entry) { return entry.address == handle->address && &entry != &*handle; };
  const auto neighbours =
      std::ranges::count_if(entries_, [&](const Entry& e) { return is_neighbour(e) && !e.is_leaving; });
  return neighbours < limits_.connections_of_address || drop_slowest(handle->arrived, is_neighbour);
}

void Connections::remove(Handle handle) {
  const std::lock_guard guard(mutex_);
  entries_.erase(handle);
}

void Connections::set_waiting(Handle handle, std::optional<Wait> waiting) {
  const std::lock_guard guard(mutex_);
  handle->waiting = waiting;
  if (has_ended_ && waiting) ::shutdown(handle->socket, SHUT_RDWR);
}

void Connections::end() {
  const std::lock_guard guard(mutex_);
  has_ended_ = true;
  while (drop_slowest(Clock::time_point::max(), [](const Entry&) { return true; })) {
  }
}

// ---- a connection -------------------------------------------------------------------------------------------------

/// A socket whose client has a deadline for each request as a whole, not for each of its bytes.
class HttpServer::Connection final : public httplib::Stream {
 public:
  Connection(socket_t socket, Connections& all, const ConnectionLimits& limits)
      : socket_(socket),
        all_(all),
        limits_(limits),
        peer_(peer_of(socket)),
        handle_(all.add(socket, peer_.first, arrival)) {
    // The system would wait a quarter of an hour for the receipts of a client that vanished without closing.
    const auto milliseconds = unsigned(std::chrono::milliseconds(limits.stalled).count());
    ::setsockopt(socket, IPPROTO_TCP, TCP_USER_TIMEOUT, &milliseconds, sizeof milliseconds);
  }
  ~Connection() override {
    all_.remove(handle_);  // first: the number may be another connection's once it is closed
    ::shutdown(socket_, SHUT_RDWR);
    ::close(socket_);
  }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  [[nodiscard]] bool is_admitted() { return all_.admit(handle_); }
  /// Waits for the first byte of a request, from which its time runs.
  [[nodiscard]] bool wait_for_request() {
    request_begin_ = Clock::now();
    if (unread_.empty() && !wait(POLLIN, request_begin_, request_begin_ + limits_.idle)) return false;
    request_begin_ = Clock::now();
    request_bytes_ = unread_.size();
    return true;
  }

  ssize_t read(char* to, std::size_t size) override {
    if (unread_.empty()) {
      const std::chrono::seconds of_bytes(request_bytes_ / limits_.least_rate);
      if (!wait(POLLIN, request_begin_, request_begin_ + limits_.request + of_bytes)) return -1;
      const ssize_t got = ::recv(socket_, buffer_.data(), buffer_.size(), MSG_DONTWAIT);
      if (got <= 0) return got;
      unread_ = std::string_view(buffer_.data(), std::size_t(got));
      request_bytes_ += unread_.size();
    }
    if (request_bytes_ > limits_.request_bytes) return -1;
    const std::size_t count = unread_.copy(to, size);
    unread_.remove_prefix(count);
    return ssize_t(count);
  }
  ssize_t write(const char* from, std::size_t size) override {
    for (;;) {
      const ssize_t put = ::send(socket_, from, size, MSG_NOSIGNAL | MSG_DONTWAIT);
      if (put >= 0) return put;
      if (errno == EINTR) continue;
      if (errno != EAGAIN || !is_writable()) return -1;
    }
  }
  [[nodiscard]] bool is_readable() const override { return !unread_.empty() || wait(POLLIN, Clock::now(), {}); }
  [[nodiscard]] bool is_writable() const override {
    const auto now = Clock::now();
    return wait(POLLOUT, now, now + limits_.stalled);
  }
  void get_remote_ip_and_port(std::string& ip, int& port) const override { std::tie(ip, port) = peer_; }
  void get_local_ip_and_port(std::string& ip, int& port) const override {
    sockaddr_storage address{};
    socklen_t size = sizeof address;
    if (::getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size) == 0) {
      std::tie(ip, port) = address_of(address, size);
    }
  }
  [[nodiscard]] socket_t socket() const override { return socket_; }

 private:
  /// @param since  how long the client has kept us waiting, where there are too many
  bool wait(short events, Clock::time_point since, Clock::time_point deadline) const {
    all_.set_waiting(handle_, Connections::Wait{since, events});
    int ready = 0;
    do {
      const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now()).count();
      pollfd waiting{socket_, events, 0};
      ready = ::poll(&waiting, 1, int(std::max<long long>(left, 0)));
    } while (ready == -1 && errno == EINTR);
    all_.set_waiting(handle_, std::nullopt);
    return ready > 0;
  }

  socket_t socket_;
  Connections& all_;
  const ConnectionLimits& limits_;
  std::pair<std::string, int> peer_;
  Connections::Handle handle_;
  std::array<char, 4096> buffer_;
  std::string_view unread_;  // of the buffer
  Clock::time_point request_begin_{};
  std::size_t request_bytes_ = 0;
};

// ---- the server ---------------------------------------------------------------------------------------------------

HttpServer::HttpServer(const ConnectionLimits& limits) : limits_(limits), connections_(limits) {
  new_task_queue = [this] { return new Workers(connections_, limits_.connections); };
  // An answer's head and body are sent apart: the body would wait 40 ms for the head's receipt.
  set_tcp_nodelay(true);
  set_logger([](const httplib::Request&, const httplib::Response& response) {
    is_last_answer = is_last_answer || response.status >= 400;
  });
}

void HttpServer::widen_queue() {
  (void)::listen(svr_sock_, SOMAXCONN);
}

void HttpServer::end() {
  stop();
  connections_.end();
}

bool HttpServer::process_and_close_socket(socket_t socket) {
  Connection connection(socket, connections_, limits_);
  if (!connection.is_admitted()) {
    constexpr std::string_view kRefusal = "HTTP/1.1 503 Service Unavailable\r\nConnection: close\r\n\r\n";
    (void)connection.write(kRefusal.data(), kRefusal.size());
    return false;
  }
  is_last_answer = false;
  for (std::size_t left = keep_alive_max_count_; left > 0 && svr_sock_ != INVALID_SOCKET; --left) {
    bool is_closed = false;
    const auto take_ranges = [](httplib::Request& request) { request.ranges.clear(); };  // they are ours to serve
    const auto answer = [&]<typename Server>(Server& server) {
      if constexpr (requires { server.process_request(connection, left == 1, is_closed, take_ranges); }) {
        return server.process_request(connection, left == 1, is_closed, take_ranges);
      } else {  // later versions want the addresses of both ends, which our handlers do not ask for
        return server.process_request(connection, "", 0, "", 0, left == 1, is_closed, take_ranges);
      }
    };
    if (!connection.wait_for_request() || !answer(*this)) return false;
    if (is_closed || is_last_answer) break;
  }
  return true;
}

}  // namespace cnerf::web
