#pragma once
/// What a program answers to its page beyond files. The server checks who asks and how much; the program what.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace cnerf::web {

struct PageRequest {
  std::string method;                             ///< GET, PUT or POST
  std::string path;                               ///< "/studio/frame"
  std::map<std::string, std::string> parameters;  ///< of the query
  std::string client;                             ///< X-Cnerf-Client: letters and digits; empty = none or no such name
  std::optional<int> revision;                    ///< X-Cnerf-Revision
  std::string body;
};

struct PageAnswer {
  int status = 200;
  std::string type = "application/json";
  std::string body = {};
  std::vector<std::pair<std::string, std::string>> headers = {};
  std::filesystem::path file = {};  ///< is sent in place of `body` where it is not empty
};

/// A sentence for the user, and a status that says so.
[[nodiscard]] inline PageAnswer refusal(int status, const std::string& why) {
  return {status, "text/plain; charset=utf-8", why + "\n"};
}

/// Called by many threads at once.
class PageApi {
 public:
  virtual ~PageApi() = default;
  /// "/studio": its addresses begin so; PREFIX/events is the stream of its news.
  [[nodiscard]] virtual std::string prefix() const = 0;
  /// Bytes that a body may have there; nothing where there is no such address.
  [[nodiscard]] virtual std::optional<std::size_t> largest_body(const std::string& method,
                                                                const std::string& path) const = 0;
  [[nodiscard]] virtual PageAnswer answer(const PageRequest& request) = 0;
  /// Waits up to `seconds` for another version than `after`. @return it and its state; nothing when there was none.
  [[nodiscard]] virtual std::optional<std::pair<std::uint64_t, std::string>> wait_for_news(std::uint64_t after,
                                                                                           double seconds) = 0;
  /// A client follows the news; and does no more.
  virtual void joined(const std::string& client) = 0;
  virtual void left(const std::string& client) = 0;
  /// Lets everything that waits go.
  virtual void close() = 0;
  [[nodiscard]] virtual bool closed() const = 0;
};

}  // namespace cnerf::web
