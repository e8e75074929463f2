#include "viewer/server/web_server.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <openssl/crypto.h>
#include <openssl/rand.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <thread>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/process.h"
#include "src/base/text.h"
#include "viewer/server/http_server.h"

namespace cnerf::web {
namespace {
namespace fs = std::filesystem;

constexpr std::size_t kLargestBody = 4096;                     ///< of the live page's orders
constexpr std::size_t kLargestUpload = std::size_t(64) << 20;  ///< of a page API, whatever it says
constexpr std::size_t kLeastToken = 16;
constexpr int kMostListeners = 8;  ///< tabs that follow a feed; each holds a thread

/// By the address, not by how it begins: 127.example.org is a name like any other.
bool is_loopback(const std::string& host) {
  in_addr v4{};
  in6_addr v6{};
  if (host == "localhost") return true;
  if (::inet_pton(AF_INET, host.c_str(), &v4) == 1) return ntohl(v4.s_addr) >> 24 == 127;
  return ::inet_pton(AF_INET6, host.c_str(), &v6) == 1 && IN6_IS_ADDR_LOOPBACK(&v6);
}

const char* content_type(const fs::path& file) {
  static const std::map<std::string, const char*> types{{".html", "text/html; charset=utf-8"},
                                                        {".js", "text/javascript"},
                                                        {".css", "text/css"},
                                                        {".json", "application/json"},
                                                        {".svg", "image/svg+xml"},
                                                        {".png", "image/png"},
                                                        {".jpg", "image/jpeg"},
                                                        {".webp", "image/webp"},
                                                        {".ico", "image/x-icon"},
                                                        {".txt", "text/plain; charset=utf-8"},
                                                        {".map", "application/json"}};
  const auto found = types.find(file.extension().string());
  return found == types.end() ? "application/octet-stream" : found->second;
}

/// "name:port" and "[address]:port" without the port; empty where it is neither.
std::string host_name(const std::string& header) {
  const bool is_bracketed = header.starts_with('[');
  const std::size_t end = std::min(header.find(is_bracketed ? ']' : ':'), header.size());
  const std::string port = header.substr(std::min(end + (is_bracketed ? 1 : 0), header.size()));
  const bool has_plain_port =
      port.empty() ||
      (port[0] == ':' && std::all_of(port.begin() + 1, port.end(), [](char c) { return c >= '0' && c <= '9'; }));
  if (!has_plain_port || (is_bracketed && end == header.size())) return {};
  return is_bracketed ? header.substr(1, end - 1) : header.substr(0, end);
}

/// Bytes [begin, begin + count) of a file.
struct Part {
  std::size_t begin = 0, count = 0;
};

/// What a Range header asks for; all of it where that is not one range in bytes, which HTTP allows.
/// @return  nothing where the file has no such part
std::optional<Part> part_of(const std::string& header, std::size_t size) {
  constexpr std::string_view kUnit = "bytes=";
  const Part whole{0, size};
  const std::size_t dash = header.find('-');
  if (!header.starts_with(kUnit) || dash == std::string::npos) return whole;
  const bool has_begin = dash > kUnit.size(), has_end = dash + 1 < header.size();
  const auto first = value_in<std::size_t>(header.substr(kUnit.size(), dash - kUnit.size()));
  const auto last = value_in<std::size_t>(header.substr(dash + 1));
  if ((has_begin && !first) || (has_end && !last) || (!has_begin && !has_end)) return whole;
  if (!has_begin)
    return *last == 0 ? std::nullopt : std::optional(Part{size - std::min(size, *last), std::min(size, *last)});
  if (*first >= size || (has_end && *last < *first)) return std::nullopt;
  return Part{*first, (has_end ? std::min(*last, size - 1) : size - 1) - *first + 1};
}

/// A path of this server to lead a browser to. One that begins with two slashes would be another server's.
std::string own_path(const std::string& path) {
  constexpr std::string_view kPlain = "/-_.";
  const auto is_plain = [&](unsigned char c) { return std::isalnum(c) != 0 || kPlain.find(char(c)) != kPlain.npos; };
  return std::ranges::all_of(path, is_plain) && !path.starts_with("//") && path.starts_with('/') ? path : "/";
}

bool equal_in_constant_time(const std::string& a, const std::string& b) {
  return a.size() == b.size() && CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

/// Servers on other ports of the host get the same cookies, so that each needs a name of its own.
std::string cookie_name(const std::string& token) {
  return "cnerf_token_" + sha256(std::as_bytes(std::span(token))).substr(0, 8);
}

std::string cookie_of(const httplib::Request& request, const std::string& name) {
  const std::string header = request.get_header_value("Cookie");
  const std::string key = name + "=";
  for (std::size_t at = 0; at < header.size();) {
    std::size_t end = header.find(';', at);
    if (end == std::string::npos) end = header.size();
    while (at < end && header[at] == ' ') ++at;
    if (header.compare(at, key.size(), key) == 0) return header.substr(at + key.size(), end - at - key.size());
    at = end + 1;
  }
  return {};
}

/// The name a page gave itself; empty where that is none. An event stream cannot send headers.
std::string client_of(const httplib::Request& request) {
  const std::string name = request.has_header("X-Cnerf-Client") ? request.get_header_value("X-Cnerf-Client")
                                                                : request.get_param_value("client");
  const bool is_plain = std::ranges::all_of(name, [](unsigned char c) { return std::isalnum(c) != 0; });
  return is_plain && name.size() >= 8 && name.size() <= 32 ? name : "";
}

/// Whether a page of another site asks, and not a visitor who follows its link. Browsers would let any page open our
/// event streams, but they say who asks.
bool is_of_another_site(const httplib::Request& request) {
  return request.get_header_value("Sec-Fetch-Site") == "cross-site" &&
         request.get_header_value("Sec-Fetch-Dest") != "document";
}

/// The same for a name each time, and of those that Linux does not hand out by itself.
int port_for(const std::string& name) {
  constexpr unsigned long kFirst = 61000, kCount = 4000;
  return int(kFirst + std::stoul(sha256(std::as_bytes(std::span(name))).substr(0, 8), nullptr, 16) % kCount);
}

void refuse(httplib::Response& response, int status, const std::string& why) {
  response.status = status;
  response.set_header("Connection", "close");  // a thread is not to wait for who was refused
  response.set_content(why + "\n", "text/plain; charset=utf-8");
}

}  // namespace

void check_web_server_options(const WebServerOptions& options) {
  if (!is_loopback(options.host) && options.token.empty()) {
    throw UsageError("--host " + options.host + ": others could look, so it needs --token; for example --token " +
                     random_token());
  }
  const bool plain = std::ranges::all_of(
      options.token, [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_'; });
  if (!options.token.empty() && (!plain || options.token.size() < kLeastToken)) {
    throw UsageError(fmt::format("--token: expected at least {} letters, digits, - or _, got {} characters",
                                 kLeastToken, options.token.size()));
  }
}

std::string random_token() {
  constexpr std::string_view kLetters = "abcdefghijkmnpqrstuvwxyz23456789";  // 32, none alike
  unsigned char bytes[32];
  if (RAND_bytes(bytes, sizeof bytes) != 1) throw DeviceError("OpenSSL: no random numbers");
  std::string token;
  for (const unsigned char byte : bytes) token += kLetters[byte % kLetters.size()];
  return token;
}

/// What a server with uploads takes from a client.
ConnectionLimits limits_for(const PageApi* api) {
  ConnectionLimits limits;
  if (api == nullptr) return limits;
  limits.request_bytes += kLargestUpload;
  limits.request = std::chrono::seconds(60);
  return limits;
}

struct WebServer::State {
  std::vector<fs::path> folders;
  WebServerOptions options;
  LiveFeed* feed = nullptr;
  PageApi* api = nullptr;
  std::unique_ptr<HttpServer> http;
  std::thread thread;
  int port = 0;
  std::atomic<int> listeners{0};

  /// The file behind an address; empty when there is none, or it is not below the folder it was found in.
  [[nodiscard]] fs::path find(const std::string& path) const {
    if (path.find('\0') != std::string::npos || path.find('\\') != std::string::npos) return {};
    const fs::path relative = fs::path(path).relative_path();
    for (const fs::path& part : relative) {
      if (part == ".." || part.string().starts_with('.')) return {};
    }
    for (const fs::path& folder : folders) {
      std::error_code failure;
      const fs::path root = fs::canonical(folder, failure);
      if (failure) continue;
      fs::path wanted = root / relative;
      if (relative.empty() || fs::is_directory(wanted, failure)) wanted /= "index.html";
      const fs::path file = fs::canonical(wanted, failure);  // resolves links
      if (failure || !fs::is_regular_file(file, failure)) continue;
      const auto [end, ignored] = std::mismatch(root.begin(), root.end(), file.begin(), file.end());
      if (end == root.end()) return file;
    }
    return {};
  }

  [[nodiscard]] bool is_known_host(const httplib::Request& request) const {
    const std::string host = host_name(request.get_header_value("Host"));
    if (host.empty() || request.get_header_value_count("Host") != 1) return false;
    return !is_loopback(options.host) || is_loopback(host);
  }

  /// @return whether the request goes no further.
  bool check(const httplib::Request& request, httplib::Response& response) const {
    response.set_header("X-Content-Type-Options", "nosniff");
    response.set_header("Referrer-Policy", "no-referrer");
    response.set_header("Cache-Control", "no-cache");
    response.set_header("Content-Security-Policy",
                        "default-src 'self'; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; "
                        "frame-ancestors 'none'; base-uri 'none'; form-action 'none'");
    const bool control = request.method == "POST" && request.path == "/live/control";
    const std::optional<std::size_t> of_api =
        api != nullptr ? api->largest_body(request.method, request.path) : std::nullopt;
    const bool is_order = control || (of_api && request.method != "GET");
    if (request.method != "GET" && request.method != "HEAD" && !is_order) {
      refuse(response, 405, "only GET and HEAD");
      return true;
    }
    // Before the body is read: a client may promise gigabytes, or not say how many.
    const std::string stated = request.get_header_value("Content-Length");
    const std::optional<std::size_t> length = value_in<std::size_t>(stated);
    if (is_order && !length) {
      refuse(response, 411, "the length of the body is not stated");
      return true;
    }
    if (is_order && request.has_header("Content-Encoding")) {  // it would be unpacked to any size
      refuse(response, 415, "the body is packed; send it as it is");
      return true;
    }
    const std::size_t largest = of_api ? *of_api : kLargestBody;
    if (length.value_or(0) > largest) {
      refuse(response, 413, fmt::format("at most {} bytes are taken here", largest));
      return true;
    }
    if (!is_known_host(request)) {
      refuse(response, 421, "this server answers to its own name only");
      return true;
    }
    if (is_of_another_site(request)) {
      refuse(response, 403, "pages of other sites may link here, no more");
      return true;
    }
    // Browsers say where a request comes from, programs need not.
    if (is_order && request.has_header("Origin") &&
        request.get_header_value("Origin") != "http://" + request.get_header_value("Host")) {
      refuse(response, 403, "orders come from the server's own page only");
      return true;
    }
    if (options.token.empty()) return false;
    if (equal_in_constant_time(request.get_param_value("token"), options.token)) {
      // Not Strict: who follows a link of another site would come without it.
      response.set_header("Set-Cookie",
                          cookie_name(options.token) + "=" + options.token + "; HttpOnly; SameSite=Lax; Path=/");
      response.set_redirect(own_path(request.path), 303);
      return true;
    }
    if (equal_in_constant_time(cookie_of(request, cookie_name(options.token)), options.token)) return false;
    refuse(response, 401, "open the address with its ?token=");
    return true;
  }

  void serve_file(const httplib::Request& request, httplib::Response& response) const {
    const fs::path file = find(request.path);
    if (file.empty()) return refuse(response, 404, "not here");
    send_file(file, request, response);
  }

  static void send_file(const fs::path& file, const httplib::Request& request, httplib::Response& response) {
    const auto opened =
        std::make_shared<FileDescriptor>(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOFOLLOW));
    struct stat state {};
    if (opened->number() < 0 || ::fstat(opened->number(), &state) != 0 || !S_ISREG(state.st_mode)) {
      return refuse(response, 404, "not here");
    }
    const auto size = std::size_t(state.st_size);
    response.set_header("Accept-Ranges", "bytes");
    if (size == 0) return response.set_content("", content_type(file));
    const std::optional<Part> part = part_of(request.get_header_value("Range"), size);
    if (!part) {
      response.set_header("Content-Range", fmt::format("bytes */{}", size));
      return refuse(response, 416, "the file has no such part");
    }
    if (part->count < size) {
      response.status = 206;
      response.set_header("Content-Range",
                          fmt::format("bytes {}-{}/{}", part->begin, part->begin + part->count - 1, size));
    }
    // Piece by piece: memory does not grow with files and visitors.
    response.set_content_provider(
        part->count, content_type(file),
        [opened, begin = part->begin](std::size_t offset, std::size_t length, httplib::DataSink& sink) {
          std::array<char, 65536> piece;
          const ::ssize_t got = ::pread(opened->number(), piece.data(), std::min(length, piece.size()),
                                        static_cast<::off_t>(begin + offset));
          return got > 0 && sink.write(piece.data(), std::size_t(got));
        });
  }

  /// Sends the news of `source`, a feed or an API, as they come.
  /// @param pause  between two of them
  /// @param end    is called when nobody follows any more
  template <typename Source>
  void follow(Source* source, std::chrono::milliseconds pause, httplib::Response& response, std::function<void()> end) {
    if (listeners.fetch_add(1) >= kMostListeners) {
      listeners.fetch_sub(1);
      end();
      return refuse(response, 503, "too many tabs follow already");
    }
    auto version = std::make_shared<std::uint64_t>(0);
    response.set_chunked_content_provider(
        "text/event-stream",
        [this, source, pause, version](std::size_t, httplib::DataSink& sink) {
          const auto news = source->wait_for_news(*version, 2.0);
          if (!news && (source->closed() || !http->is_running())) {
            sink.done();
            return true;
          }
          if (!news) return sink.write(":\n\n", 3);  // keeps the line open, and notices a closed tab
          *version = news->first;
          const std::string event = "data: " + news->second + "\n\n";
          const bool sent = sink.write(event.data(), event.size());
          std::this_thread::sleep_for(pause);
          return sent;
        },
        [this, end = std::move(end)](bool) {
          listeners.fetch_sub(1);
          end();
        });
  }

  void answer_page(const httplib::Request& request, httplib::Response& response) {
    PageRequest asked{request.method, request.path, {}, {}, {}, request.body};
    if (request.method != "GET" && request.get_header_value("X-Cnerf") != "1") {
      return refuse(response, 403, "the header X-Cnerf is missing");
    }
    for (const auto& [name, value] : request.params) asked.parameters[name] = value;
    asked.client = client_of(request);
    if (const auto revision = value_in<std::size_t>(request.get_header_value("X-Cnerf-Revision"))) {
      asked.revision = int(std::min<std::size_t>(*revision, std::numeric_limits<int>::max()));
    }
    if (request.method == "GET" && request.path == api->prefix() + "/events") {
      api->joined(asked.client);
      return follow(api, std::chrono::milliseconds(60), response, [this, asked] { api->left(asked.client); });
    }
    PageAnswer answer = api->answer(asked);
    response.status = answer.status;
    for (const auto& [name, value] : answer.headers) response.set_header(name, value);
    if (!answer.file.empty()) return send_file(answer.file, request, response);
    response.set_content(answer.body, answer.type);
  }

  void control(const httplib::Request& request, httplib::Response& response) {
    if (request.get_header_value("X-Cnerf") != "1") return refuse(response, 403, "the header X-Cnerf is missing");
    std::string action;
    try {
      action = nlohmann::json::parse(request.body).at("action").get<std::string>();
    } catch (const nlohmann::json::exception&) {
      return refuse(response, 400, "expected {\"action\": \"pause\" | \"resume\" | \"stop\"}");
    }
    if (action == "pause" || action == "resume") {
      feed->request_pause(action == "pause");
    } else if (action == "stop") {
      feed->request_stop();
    } else {
      return refuse(response, 400, "unknown action");
    }
    response.set_content(feed->state(), "application/json");
  }

  void route(HttpServer& server) {
    // The library's default also allows a second server on the same port.
    server.set_socket_options([](socket_t socket) {
      const int yes = 1;
      ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    });
    server.set_payload_max_length(api != nullptr ? kLargestUpload : kLargestBody);
    server.set_keep_alive_max_count(200);
    server.set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
      return check(request, response) ? httplib::Server::HandlerResponse::Handled
                                      : httplib::Server::HandlerResponse::Unhandled;
    });
    server.set_exception_handler([](const httplib::Request&, httplib::Response& response, const std::exception_ptr&) {
      refuse(response, 500, "this cannot be read");
    });
    if (feed != nullptr) {
      server.Get("/live/state", [this](const httplib::Request&, httplib::Response& response) {
        response.set_content(feed->state(), "application/json");
      });
      server.Get("/live/events", [this](const httplib::Request&, httplib::Response& response) {
        follow(feed, std::chrono::milliseconds(400), response, [] {});  // enough to look at
      });
      server.Get(R"(/live/pictures/([\w.-]{1,80}))",
                 [this](const httplib::Request& request, httplib::Response& response) {
                   const auto bytes = feed->picture(request.matches[1]);
                   if (!bytes) return refuse(response, 404, "not here");
                   response.set_content(*bytes, "image/jpeg");
                 });
      server.Post("/live/control",
                  [this](const httplib::Request& request, httplib::Response& response) { control(request, response); });
    }
    if (api != nullptr) {
      const auto answer = [this](const httplib::Request& request, httplib::Response& response) {
        answer_page(request, response);
      };
      const std::string below = api->prefix() + "/.*";
      server.Get(below, answer).Put(below, answer).Post(below, answer);
    }
    server.Get(".*",
               [this](const httplib::Request& request, httplib::Response& response) { serve_file(request, response); });
  }

  /// @param wanted  0 = any that is free.  @return  whether it could be had
  bool bind(int wanted) {
    http = std::make_unique<HttpServer>(limits_for(api));  // later versions of the library try once only
    route(*http);
    if (wanted == 0) {
      port = http->bind_to_any_port(options.host);
    } else {
      port = http->bind_to_port(options.host, wanted) ? wanted : -1;
    }
    return port > 0;
  }
};

WebServer::WebServer(std::vector<fs::path> folders, const WebServerOptions& options, LiveFeed* feed, PageApi* api)
    : state_(std::make_unique<State>()) {
  check_web_server_options(options);
  state_->folders = std::move(folders);
  state_->options = options;
  state_->feed = feed;
  state_->api = api;
}

WebServer::~WebServer() {
  stop();
}

void WebServer::start() {
  State& s = *state_;
  const WebServerOptions& options = s.options;
  const bool is_named = options.port == 0 && !options.name.empty();
  if (!(is_named && s.bind(port_for(options.name))) && !s.bind(options.port)) {
    throw DeviceError(fmt::format("{}:{}: cannot be listened on; is the port in use, or the address another machine's?",
                                  options.host, options.port > 0 ? std::to_string(options.port) : "any"));
  }
  s.http->widen_queue();
  s.thread = std::thread([&s] { s.http->listen_after_bind(); });
  while (!s.http->is_running()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

void WebServer::stop() {
  if (!state_->thread.joinable()) return;
  if (state_->feed != nullptr) state_->feed->close();
  if (state_->api != nullptr) state_->api->close();
  state_->http->end();
  state_->thread.join();
}

int WebServer::port() const {
  return state_->port;
}

std::string WebServer::address() const {
  const WebServerOptions& options = state_->options;
  std::string host = options.host == "0.0.0.0" || options.host == "::" ? "127.0.0.1" : options.host;
  if (host.find(':') != std::string::npos) host = "[" + host + "]";
  const std::string query = options.token.empty() ? "" : "?token=" + options.token;
  return fmt::format("http://{}:{}/{}", host, state_->port, query);
}

bool open_browser(const std::string& address) {
  if (std::getenv("DISPLAY") == nullptr && std::getenv("WAYLAND_DISPLAY") == nullptr) return false;
  if (::access("/usr/bin/xdg-open", X_OK) != 0) return false;
  const pid_t child = ::fork();
  if (child != 0) return child > 0 && (::waitpid(child, nullptr, 0), true);
  if (::fork() == 0) {  // a grandchild is nobody's to wait for
    ::execl("/usr/bin/xdg-open", "xdg-open", address.c_str(), static_cast<char*>(nullptr));
    ::_exit(127);
  }
  ::_exit(0);
}

}  // namespace cnerf::web
