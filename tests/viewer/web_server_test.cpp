#include "viewer/server/web_server.h"

#include <gtest/gtest.h>
#include <httplib.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "src/base/error.h"
#include "src/base/files.h"
#include "tests/support/data.h"
#include "tests/support/sanitizers.h"
#include "viewer/server/http_server.h"
#include "viewer/server/page_relay.h"

namespace cnerf::web {
namespace {
namespace fs = std::filesystem;

/// A folder to serve, with a secret beside it.
struct Site {
  cnerf::test::TempDir folder;
  fs::path root = folder / "site";

  Site() {
    write_file(root / "index.html", std::string_view("<h1>page</h1>"));
    write_file(root / "bundle.json", std::string_view("{}"));
    write_file(root / "photos" / "000.jpg", std::string_view("jpeg"));
    write_file(root / ".hidden", std::string_view("hidden"));
    write_file(folder / "secret.txt", std::string_view("secret"));
    fs::create_symlink(folder / "secret.txt", root / "link.txt");
    fs::create_directory_symlink(folder.path(), root / "up");
  }
};

/// What the server says to raw bytes.
std::string raw_answer(int port, const std::string& bytes) {
  const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(std::uint16_t(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  timeval patience{8, 0};
  ::setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  std::string answer;
  if (::connect(socket, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0) {
    (void)::send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    char block[4096];
    for (ssize_t n; (n = ::recv(socket, block, sizeof block, 0)) > 0;) answer.append(block, std::size_t(n));
  }
  ::close(socket);
  return answer;
}

int status_of(const std::string& answer) {
  return answer.size() > 12 ? std::stoi(answer.substr(9, 3)) : 0;
}

std::string request(const std::string& line, const std::string& more = "Host: 127.0.0.1\r\n") {
  return line + " HTTP/1.1\r\n" + more + "Connection: close\r\n\r\n";
}

/// What a browser keeps of an answer's cookie: "name=value".
std::string cookie_in(const std::string& answer) {
  const std::string key = "Set-Cookie: ";
  const std::size_t begin = answer.find(key);
  if (begin == std::string::npos) return "";
  return answer.substr(begin + key.size(), answer.find(';', begin) - begin - key.size());
}

TEST(WebServer, ServesFilesWithTheirTypes) {
  const Site site;
  WebServer server({site.root}, {});
  server.start();
  httplib::Client client("127.0.0.1", server.port());
  const auto page = client.Get("/");
  ASSERT_TRUE(page);
  EXPECT_EQ(page->body, "<h1>page</h1>");
  EXPECT_EQ(page->get_header_value("Content-Type"), "text/html; charset=utf-8");
  EXPECT_NE(page->get_header_value("Content-Security-Policy"), "");
  EXPECT_EQ(client.Get("/photos/000.jpg?v=1")->get_header_value("Content-Type"), "image/jpeg");
  EXPECT_EQ(client.Head("/bundle.json")->status, 200);
  EXPECT_EQ(client.Get("/nothing")->status, 404);
  EXPECT_EQ(client.Get("/live/state")->status, 404) << "no feed, no feed's addresses";
  EXPECT_EQ(server.address(), "http://127.0.0.1:" + std::to_string(server.port()) + "/");
}

TEST(WebServer, TheFirstFolderWins) {
  const Site site;
  const cnerf::test::TempDir page;
  write_file(page / "index.html", std::string_view("newer"));
  WebServer server({page.path(), site.root}, {});
  server.start();
  httplib::Client client("127.0.0.1", server.port());
  EXPECT_EQ(client.Get("/")->body, "newer");
  EXPECT_EQ(client.Get("/bundle.json")->body, "{}");
}

TEST(WebServer, NoPathAndNoLinkLeavesTheFolder) {
  const Site site;
  WebServer server({site.root}, {});
  server.start();
  for (const char* path : {"/../secret.txt", "/photos/../../secret.txt", "/%2e%2e/secret.txt", "/..%2fsecret.txt",
                           "/..\\secret.txt", "/link.txt", "/up/secret.txt", "/.hidden", "//etc/passwd", "/%00",
                           "/photos/%2e%2e/%2e%2e/secret.txt", "/photos"}) {
    const std::string answer = raw_answer(server.port(), request(std::string("GET ") + path));
    EXPECT_GE(status_of(answer), 400) << path;
    EXPECT_EQ(answer.find("secret\n"), std::string::npos);
    EXPECT_EQ(answer.find("\r\n\r\nsecret"), std::string::npos) << path;
    EXPECT_EQ(answer.find("root:"), std::string::npos) << path;
  }
  EXPECT_EQ(status_of(raw_answer(server.port(), request("GET /photos/../index.html"))), 404);
  EXPECT_EQ(status_of(raw_answer(server.port(), request("GET /index.html"))), 200) << "the same way does find files";
}

TEST(WebServer, RefusesOtherMethodsLargeAndMalformedRequests) {
  const Site site;
  WebServer server({site.root}, {});
  server.start();
  const int port = server.port();
  for (const char* method : {"POST", "PUT", "DELETE", "OPTIONS", "PATCH"}) {
    EXPECT_EQ(status_of(raw_answer(
                  port, request(std::string(method) + " /index.html", "Host: 127.0.0.1\r\nContent-Length: 0\r\n"))),
              405)
        << method;
  }
  EXPECT_GE(status_of(raw_answer(port, request("GET /" + std::string(20'000, 'a')))), 400);
  const std::string large =
      "POST /index.html HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\nContent-Length: 100000\r\n\r\n" +
      std::string(100'000, 'x');
  const int status = status_of(raw_answer(port, large));
  EXPECT_TRUE(status == 0 || status >= 400) << status;
  for (const char* nonsense : {"hello\r\n\r\n", "GET\r\n\r\n", "\r\n\r\n", "GET / HTTP/9.9\r\n\r\n"}) {
    const int answer = status_of(raw_answer(port, nonsense));
    EXPECT_TRUE(answer == 0 || answer >= 400) << nonsense;
  }
  EXPECT_EQ(status_of(raw_answer(port, request("GET /"))), 200) << "and goes on";
}

TEST(WebServer, AnswersToItsOwnNameOnly) {
  const Site site;
  WebServer server({site.root}, {});
  server.start();
  EXPECT_EQ(status_of(raw_answer(server.port(), request("GET /", "Host: evil.example:80\r\n"))), 421);
  EXPECT_EQ(status_of(raw_answer(server.port(), request("GET /", ""))), 421);
  EXPECT_EQ(status_of(raw_answer(server.port(), request("GET /", "Host: localhost:99\r\n"))), 200);
}

TEST(WebServer, AnotherHostNeedsATokenAndVisitorsToo) {
  EXPECT_THROW(check_web_server_options({"0.0.0.0", 0, ""}), UsageError);
  EXPECT_THROW(check_web_server_options({"0.0.0.0", 0, "short"}), UsageError);
  EXPECT_THROW(check_web_server_options({"127.0.0.1", 0, "with spaces and more"}), UsageError);
  const std::string token = random_token();
  EXPECT_NE(token, random_token());
  const Site site;
  WebServer server({site.root}, {"0.0.0.0", 0, token});
  server.start();
  const int port = server.port();
  EXPECT_EQ(status_of(raw_answer(port, request("GET /"))), 401);
  EXPECT_EQ(status_of(raw_answer(port, request("GET /?token=" + std::string(32, 'a')))), 401);
  const std::string welcome = raw_answer(port, request("GET /?token=" + token));
  EXPECT_EQ(status_of(welcome), 303);
  EXPECT_NE(welcome.find("HttpOnly; SameSite=Lax"), std::string::npos) << "a link of another site brings it along";
  EXPECT_EQ(status_of(raw_answer(port, request("GET /", "Host: a\r\nCookie: x=1; " + cookie_in(welcome) + "\r\n"))),
            200);
  EXPECT_NE(server.address().find("?token=" + token), std::string::npos);
}

TEST(WebServer, WhoVisitsTwoServersOfAHostStaysWelcomeAtBoth) {
  const Site site;
  const std::array<std::string, 2> tokens = {random_token(), random_token()};
  WebServer one({site.root}, {"127.0.0.1", 0, tokens[0]}), other({site.root}, {"127.0.0.1", 0, tokens[1]});
  one.start();
  other.start();
  std::map<std::string, std::string> jar;  // a browser's, which does not ask for the port
  const auto visit = [&](const WebServer& server, const std::string& token) {
    const std::string cookie = cookie_in(raw_answer(server.port(), request("GET /?token=" + token)));
    jar[cookie.substr(0, cookie.find('='))] = cookie;
  };
  visit(one, tokens[0]);
  visit(other, tokens[1]);
  std::string cookies;
  for (const auto& [name, cookie] : jar) cookies.append(cookies.empty() ? "" : "; ").append(cookie);
  for (const WebServer* server : {&one, &other}) {
    const std::string head = "Host: 127.0.0.1\r\nCookie: " + cookies + "\r\n";
    EXPECT_EQ(status_of(raw_answer(server->port(), request("GET /", head))), 200) << cookies;
  }
}

TEST(WebServer, NamesThatBeginLikeAnAddressAreNames) {
  const Site site;
  WebServer server({site.root}, {});
  server.start();
  const auto status = [&](const std::string& host) {
    return status_of(raw_answer(server.port(), request("GET /", "Host: " + host + "\r\n")));
  };
  for (const char* host :
       {"127.attacker.example", "127.attacker.example:80", "127.0.0.1.example", "127.1.example:1", "127.0.0.1:80x",
        "127.0.0.1:1@evil", "[::1", "[::1]x", "[::2]:80", "128.0.0.1", "127.0.0.1\r\nHost: b"}) {
    EXPECT_EQ(status(host), 421) << host;
  }
  for (const char* host : {"127.0.0.1", "127.3.2.1:80", "[::1]:80", "[::1]", "localhost:80"})
    EXPECT_EQ(status(host), 200) << host;
  EXPECT_THROW(check_web_server_options({"127.attacker.example", 0, ""}), UsageError);
  check_web_server_options({"127.0.0.9", 0, ""});
}

TEST(WebServer, OrdersComeFromItsOwnPage) {
  LiveFeed feed("train");
  WebServer server({}, {}, &feed);
  server.start();
  const auto stop = [&](const std::string& origin) {
    return status_of(
        raw_answer(server.port(), "POST /live/control HTTP/1.1\r\nHost: 127.0.0.1:80\r\nX-Cnerf: 1\r\n" + origin +
                                      "Connection: close\r\nContent-Length: 17\r\n\r\n{\"action\":\"stop\"}"));
  };
  EXPECT_EQ(stop("Origin: http://evil.example\r\n"), 403);
  EXPECT_EQ(stop("Origin: null\r\n"), 403);
  EXPECT_EQ(stop("Origin: http://127.0.0.1:81\r\n"), 403);
  EXPECT_FALSE(feed.stop_requested());
  EXPECT_EQ(stop("Origin: http://127.0.0.1:80\r\n"), 200);
  EXPECT_TRUE(feed.stop_requested());
}

TEST(WebServer, OtherSitesMayLinkToItAndNoMore) {
  const Site site;
  LiveFeed feed("train");
  WebServer server({site.root}, {}, &feed);
  server.start();
  const auto status = [&](const std::string& path, const std::string& from, const std::string& use) {
    const std::string said = "Sec-Fetch-Site: " + from + "\r\nSec-Fetch-Dest: " + use + "\r\n";
    return status_of(raw_answer(server.port(), request("GET " + path, "Host: 127.0.0.1\r\n" + said)));
  };
  EXPECT_EQ(status("/", "cross-site", "document"), 200);
  EXPECT_EQ(status("/", "cross-site", "iframe"), 403);
  EXPECT_EQ(status("/live/events", "cross-site", "empty"), 403) << "eight would keep its own page from following";
  EXPECT_EQ(status("/photos/000.jpg", "cross-site", "image"), 403);
  EXPECT_EQ(status("/photos/000.jpg", "same-origin", "image"), 200);
}

/// Answers with what it was asked.
class Echo final : public PageApi {
 public:
  explicit Echo(fs::path file) : file_(std::move(file)) {}
  [[nodiscard]] std::string prefix() const override { return "/echo"; }
  [[nodiscard]] std::optional<std::size_t> largest_body(const std::string& method,
                                                        const std::string& path) const override {
    if (path == "/echo/order" && (method == "POST" || method == "PUT")) return 20;
    return method == "GET" ? std::optional<std::size_t>(0) : std::nullopt;
  }
  [[nodiscard]] PageAnswer answer(const PageRequest& request) override {
    if (request.path == "/echo/file") return {.file = file_};
    const auto side = request.parameters.find("side");
    return {.body = request.method + " " + request.client + " " + std::to_string(request.revision.value_or(-1)) + " " +
                    (side == request.parameters.end() ? "" : side->second) + " " + request.body};
  }
  [[nodiscard]] std::optional<std::pair<std::uint64_t, std::string>> wait_for_news(std::uint64_t after,
                                                                                   double /*seconds*/) override {
    return after == 0 ? std::optional(std::pair<std::uint64_t, std::string>{1, "news"}) : std::nullopt;
  }
  void joined(const std::string& client) override { followers = "joined " + client; }
  void left(const std::string& client) override { followers = "left " + client; }
  void close() override { is_closed_ = true; }
  [[nodiscard]] bool closed() const override { return is_closed_ || followers.starts_with("joined"); }

  std::string followers;

 private:
  fs::path file_;
  bool is_closed_ = false;
};

TEST(WebServer, APageApiIsAskedByItsOwnPageOnlyAndWithinItsLimits) {
  const Site site;
  Echo echo(site.root / "bundle.json");
  WebServer server({site.root}, {}, nullptr, &echo);
  server.start();
  const auto order = [&](const std::string& line, const std::string& more, const std::string& body) {
    return raw_answer(server.port(),
                      line + " HTTP/1.1\r\nHost: 127.0.0.1:80\r\n" + more + "Connection: close\r\n\r\n" + body);
  };
  const std::string own = "X-Cnerf: 1\r\nX-Cnerf-Client: painter123\r\nX-Cnerf-Revision: 7\r\nContent-Length: 4\r\n";
  EXPECT_NE(order("PUT /echo/order?side=3", own, "body").find("PUT painter123 7 3 body"), std::string::npos);
  EXPECT_EQ(status_of(order("POST /echo/order", "Content-Length: 4\r\n", "body")), 403) << "any site can send that";
  EXPECT_EQ(status_of(order("POST /echo/order", own + "Origin: http://evil.example\r\n", "body")), 403);
  EXPECT_EQ(status_of(order("POST /echo/order", own + "Origin: http://127.0.0.1:80\r\n", "body")), 200);
  EXPECT_EQ(status_of(order("POST /echo/order", "X-Cnerf: 1\r\nContent-Length: 21\r\n", std::string(21, 'x'))), 413);
  EXPECT_EQ(status_of(order("POST /echo/order", "X-Cnerf: 1\r\nContent-Length: 99999999999\r\n", "")), 413);
  EXPECT_EQ(status_of(order("POST /echo/order", "X-Cnerf: 1\r\nTransfer-Encoding: chunked\r\n", "1\r\nx\r\n0\r\n\r\n")),
            411);
  EXPECT_EQ(status_of(order("POST /echo/order", own + "Content-Encoding: gzip\r\n", "body")), 415) << "of what size?";
  EXPECT_EQ(status_of(order("POST /echo/other", own, "body")), 405);
  EXPECT_EQ(status_of(order("DELETE /echo/order", own, "body")), 405);
  EXPECT_NE(order("GET /echo/x", "X-Cnerf-Client: ../../etc\r\n", "").find("GET  -1"), std::string::npos);
  EXPECT_NE(order("GET /echo/file", "", "").find("\r\n\r\n{}"), std::string::npos);
  EXPECT_NE(order("GET /echo/events?client=follower1", "", "").find("data: news"), std::string::npos);
  server.stop();  // it tells who left before its threads end
  EXPECT_EQ(echo.followers, "left follower1");
}

/// One that ends its news at once, of a version of its own.
class Stage final : public PageApi {
 public:
  Stage(std::string name, std::uint64_t version) : name_(std::move(name)), version_(version) {}
  [[nodiscard]] std::string prefix() const override { return "/stage"; }
  [[nodiscard]] std::optional<std::size_t> largest_body(const std::string&, const std::string&) const override {
    return 9;
  }
  [[nodiscard]] PageAnswer answer(const PageRequest&) override { return {.body = name_}; }
  [[nodiscard]] std::optional<std::pair<std::uint64_t, std::string>> wait_for_news(std::uint64_t after,
                                                                                   double) override {
    return after == version_ ? std::nullopt : std::optional(std::pair(version_, name_));
  }
  void joined(const std::string& client) override { followers.insert(client); }
  void left(const std::string& client) override { followers.extract(client); }
  void close() override { is_closed_ = true; }
  [[nodiscard]] bool closed() const override { return is_closed_; }

  std::multiset<std::string> followers;

 private:
  std::string name_;
  std::uint64_t version_;
  bool is_closed_ = false;
};

TEST(PageRelay, AnswersByOneStageAfterAnotherAndFollowersGoOn) {
  PageRelay relay("/stage");
  EXPECT_EQ(relay.answer({}).status, 503);
  const auto first = std::make_shared<Stage>("first", 1), second = std::make_shared<Stage>("second", 2);
  relay.enter(first);
  relay.joined("a");
  relay.joined("a");
  relay.joined("b");
  EXPECT_EQ(relay.answer({}).body, "first");
  EXPECT_EQ(relay.wait_for_news(0, 0)->first, 1u);
  relay.enter(second);
  EXPECT_TRUE(first->closed());
  EXPECT_FALSE(relay.closed());
  EXPECT_EQ(relay.answer({}).body, "second");
  EXPECT_EQ(relay.wait_for_news(1, 0)->second, "second");
  EXPECT_EQ(second->followers, (std::multiset<std::string>{"a", "a", "b"}));
  relay.left("a");
  EXPECT_EQ(second->followers.count("a"), 1u);
  relay.close();
  EXPECT_TRUE(relay.closed() && second->closed());
  const auto late = std::make_shared<Stage>("late", 3);
  relay.enter(late);
  EXPECT_TRUE(late->closed());
}

std::string body_of(const std::string& answer) {
  return answer.substr(std::min(answer.size(), answer.find("\r\n\r\n") + 4));
}

TEST(WebServer, OnePartOfAFileAtMost) {
  const Site site;
  write_file(site.root / "ten.txt", std::string_view("0123456789"));
  write_file(site.root / "none.txt", std::string_view());
  WebServer server({site.root}, {});
  server.start();
  const auto part = [&](const std::string& range, const std::string& file = "ten.txt") {
    return raw_answer(server.port(), request("GET /" + file, "Host: localhost\r\nRange: bytes=" + range + "\r\n"));
  };
  EXPECT_EQ(body_of(part("2-4")), "234");
  EXPECT_EQ(status_of(part("2-4")), 206);
  EXPECT_NE(part("2-4").find("Content-Range: bytes 2-4/10\r\n"), std::string::npos);
  EXPECT_EQ(body_of(part("7-")), "789");
  EXPECT_EQ(body_of(part("7-4000000000")), "789");
  EXPECT_EQ(body_of(part("-3")), "789");
  EXPECT_EQ(body_of(part("-30")), "0123456789");
  EXPECT_EQ(status_of(part("10-")), 416);
  EXPECT_EQ(status_of(part("-0")), 416);
  EXPECT_EQ(status_of(part("0-", "none.txt")), 200);
  std::string many = "0-";
  for (int i = 0; i < 500; ++i) many += ",0-";
  EXPECT_EQ(body_of(part(many)), "0123456789") << "several parts are the whole, once";
  EXPECT_LT(part("1-2", "missing").size(), 2000u);
}

std::size_t held_bytes() {
  std::ifstream statm("/proc/self/statm");
  std::size_t pages = 0;
  statm >> pages >> pages;
  return pages * std::size_t(::sysconf(_SC_PAGESIZE));
}

TEST(WebServer, MemoryDoesNotGrowWithFiles) {
  if (cnerf::test::kIsSanitized) GTEST_SKIP() << "sanitizers hold memory for what is touched";
  const Site site;
  constexpr std::size_t kBytes = std::size_t(192) << 20;
  write_file(site.root / "large.bin", std::string_view());
  fs::resize_file(site.root / "large.bin", kBytes);
  WebServer server({site.root}, {});
  server.start();
  const std::size_t before = held_bytes();
  std::size_t most = 0;
  std::vector<std::thread> visitors;
  std::array<std::size_t, 2> got{};
  for (std::size_t& bytes : got) {
    visitors.emplace_back([&] {
      httplib::Client client("127.0.0.1", server.port());
      (void)client.Get("/large.bin", [&](const char*, std::size_t size) {
        bytes += size;
        return true;
      });
    });
  }
  for (int look = 0; look < 20; ++look) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    most = std::max(most, held_bytes());
  }
  for (std::thread& visitor : visitors) visitor.join();
  EXPECT_EQ(got[0], kBytes);
  EXPECT_EQ(got[1], kBytes);
  EXPECT_LT(std::max(most, held_bytes()), before + (std::size_t(32) << 20));
}

/// A client that connects and says no more than this.
class Slow {
 public:
  Slow(int port, const std::string& says) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(std::uint16_t(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    (void)say(says);
  }
  ~Slow() { ::close(socket_); }
  Slow(const Slow&) = delete;
  Slow& operator=(const Slow&) = delete;
  bool say(const std::string& text) {
    return ::send(socket_, text.data(), text.size(), MSG_NOSIGNAL) == ssize_t(text.size());
  }
  [[nodiscard]] in_port_t port() const {
    sockaddr_in own{};
    socklen_t size = sizeof own;
    ::getsockname(socket_, reinterpret_cast<sockaddr*>(&own), &size);
    return own.sin_port;
  }
  /// Whether the server has closed it.
  [[nodiscard]] bool is_closed() const {
    char byte;
    const ssize_t got = ::recv(socket_, &byte, 1, MSG_DONTWAIT);
    return got == 0 || (got == -1 && errno != EAGAIN);
  }

 private:
  int socket_;
};

double seconds_of(const std::function<void()>& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

TEST(WebServer, SlowClientsKeepNobodyOut) {
  const Site site;
  WebServer server({site.root}, {});
  server.start();
  for (const char* says : {"", "GET / HTTP/1.1\r\nHo", "GET /live/events HTTP/1.1\r\nHost: localhost\r\n\r\nGET"}) {
    std::vector<std::unique_ptr<Slow>> clients;
    for (int i = 0; i < 100; ++i) clients.push_back(std::make_unique<Slow>(server.port(), says));
    EXPECT_LT(seconds_of([&] { EXPECT_EQ(status_of(raw_answer(server.port(), request("GET /"))), 200); }), 2) << says;
  }
  EXPECT_LT(seconds_of([&] { server.stop(); }), 2);
}

/// A client's end and the server's.
struct Pair {
  std::array<int, 2> ends{};
  Pair() { ::socketpair(AF_UNIX, SOCK_STREAM, 0, ends.data()); }
  ~Pair() { std::ranges::for_each(ends, ::close); }
  [[nodiscard]] bool say() const { return ::send(ends[1], "G", 1, 0) == 1; }
  [[nodiscard]] bool is_dropped() const {
    char byte;
    return ::recv(ends[1], &byte, 1, MSG_DONTWAIT) == 0;
  }
};

ConnectionLimits two_of_an_address() {
  ConnectionLimits limits;
  limits.connections_of_address = 2;
  return limits;
}

TEST(Connections, WhoseWordLiesThereUnreadStays) {
  Connections all(two_of_an_address());
  const std::array<Pair, 3> pairs;
  const auto begin = Connections::Clock::now();
  std::vector<Connections::Handle> handles;
  for (const Pair& pair : pairs) handles.push_back(all.add(pair.ends[0], "somebody", all.expect()));
  all.set_waiting(handles[0], Connections::Wait{begin, POLLIN});  // the thread of the other has not begun
  ASSERT_TRUE(pairs[0].say());
  EXPECT_TRUE(all.admit(handles[2]));
  EXPECT_FALSE(pairs[0].is_dropped());
  EXPECT_TRUE(pairs[1].is_dropped());

  ASSERT_TRUE(pairs[2].say());
  EXPECT_TRUE(all.admit(all.add(-1, "somebody", all.expect()))) << "where all have said something, the first one goes";
  EXPECT_TRUE(pairs[0].is_dropped());
  EXPECT_FALSE(pairs[2].is_dropped());
}

TEST(Connections, WhoSaidSomethingDoesNotGoForOneThatCameBefore) {
  Connections all(two_of_an_address());
  const std::array<Pair, 3> pairs;
  std::array<Connections::Clock::time_point, 3> arrivals;
  for (auto& arrival : arrivals) arrival = all.expect();
  for (const int i : {1, 2}) {  // their threads began first
    (void)all.add(pairs[i].ends[0], "somebody", arrivals[i]);
    ASSERT_TRUE(pairs[i].say());
  }
  EXPECT_FALSE(all.admit(all.add(pairs[0].ends[0], "somebody", arrivals[0])));
  EXPECT_FALSE(pairs[1].is_dropped());
  EXPECT_FALSE(pairs[2].is_dropped());
}

TEST(WebServer, TabsThatFollowKeepNobodyOut) {
  const Site site;
  LiveFeed feed("train");
  WebServer server({site.root}, {}, &feed);
  server.start();
  std::vector<std::unique_ptr<Slow>> tabs;
  for (int i = 0; i < 100; ++i) {
    tabs.push_back(std::make_unique<Slow>(server.port(), "GET /live/events HTTP/1.1\r\nHost: localhost\r\n\r\n"));
  }
  EXPECT_LT(seconds_of([&] { EXPECT_EQ(status_of(raw_answer(server.port(), request("GET /"))), 200); }), 2);
}

TEST(WebServer, ARequestHasATimeAsAWhole) {
  const Site site;
  ConnectionLimits limits;
  limits.request = std::chrono::seconds(1);
  HttpServer server(limits);
  const int port = server.bind_to_any_port("127.0.0.1");
  std::thread thread([&] { server.listen_after_bind(); });
  Slow client(port, "G");
  EXPECT_LT(seconds_of([&] {
              for (int i = 0; i < 100 && !client.is_closed(); ++i) {
                (void)client.say("x");
                std::this_thread::sleep_for(std::chrono::milliseconds(50));
              }
            }),
            3);
  EXPECT_TRUE(client.is_closed());
  server.end();
  thread.join();
}

TEST(WebServer, ARequestThatComesSteadilyHasTheTimeItNeeds) {
  ConnectionLimits limits;
  limits.request = std::chrono::seconds(1);
  limits.least_rate = 2000;
  limits.request_bytes = 1 << 20;
  HttpServer server(limits);
  std::size_t got = 0;
  server.Put("/", [&](const httplib::Request& put, httplib::Response&) { got = put.body.size(); });
  const int port = server.bind_to_any_port("127.0.0.1");
  std::thread thread([&] { server.listen_after_bind(); });
  // 20 kB in two seconds and more.
  constexpr std::size_t kPieces = 20;
  Slow client(port, "PUT / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 20000\r\nConnection: close\r\n\r\n");
  for (std::size_t i = 0; i < kPieces; ++i) {
    EXPECT_TRUE(client.say(std::string(20000 / kPieces, 'x'))) << i;
    std::this_thread::sleep_for(std::chrono::milliseconds(110));
  }
  for (int i = 0; i < 100 && !client.is_closed(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_EQ(got, 20000);
  server.end();
  thread.join();
}

/// How long the server's end of a client's connection waits for receipts, milliseconds; 0 = as long as the system does.
/// Both ends are files of this process.
unsigned patience_with(const Slow& client) {
  for (int file = 0; file < 1024; ++file) {
    sockaddr_in peer{};
    socklen_t size = sizeof peer;
    if (::getpeername(file, reinterpret_cast<sockaddr*>(&peer), &size) != 0) continue;
    if (peer.sin_family != AF_INET || peer.sin_port != client.port()) continue;
    unsigned milliseconds = 0;
    size = sizeof milliseconds;
    ::getsockopt(file, IPPROTO_TCP, TCP_USER_TIMEOUT, &milliseconds, &size);
    return milliseconds;
  }
  return 0;
}

TEST(WebServer, AClientThatVanishedIsGivenUp) {
  const Site site;
  WebServer server({site.root}, {});
  server.start();
  const Slow client(server.port(), "G");
  unsigned milliseconds = 0;
  for (int look = 0; look < 100 && milliseconds == 0; ++look) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    milliseconds = patience_with(client);
  }
  EXPECT_EQ(milliseconds, unsigned(1000 * ConnectionLimits().stalled.count()));
}

TEST(WebServer, WhoIsRefusedHoldsNoThread) {
  const Site site;
  WebServer server({site.root}, {});
  server.start();
  const std::string kept = "GET /nothing HTTP/1.1\r\nHost: localhost\r\n\r\n";
  std::string answer;
  EXPECT_LT(seconds_of([&] { answer = raw_answer(server.port(), kept); }), 2) << "closed at once, not when it is idle";
  EXPECT_EQ(status_of(answer), 404);
  EXPECT_NE(answer.find("Connection: close"), std::string::npos);
}

TEST(WebServer, ATokenLeadsToOwnPathsOnly) {
  const Site site;
  const std::string token = random_token();
  WebServer server({site.root}, {"127.0.0.1", 0, token});
  server.start();
  const auto location = [&](const std::string& path) {
    const std::string answer = raw_answer(server.port(), request("GET " + path + "?token=" + token));
    const std::size_t begin = answer.find("Location: ") + 10;
    return answer.substr(begin, answer.find("\r\n", begin) - begin);
  };
  EXPECT_EQ(location("/"), "/");
  EXPECT_EQ(location("/photos/000.jpg"), "/photos/000.jpg");
  for (const char* path : {"//evil.com/", "///evil.com", "/%5cevil.com", "/%2fevil.com", "/a%0d%0aX:%20y"}) {
    EXPECT_EQ(location(path), "/") << path;
  }
}

TEST(WebServer, ATakenPortIsSaidToBe) {
  const Site site;
  WebServer first({site.root}, {});
  first.start();
  WebServer second({site.root}, {"127.0.0.1", first.port(), ""});
  EXPECT_THROW(second.start(), DeviceError);
}

TEST(WebServer, WhatHasANameIsFoundAtItsPortAgain) {
  const Site site;
  WebServerOptions options;
  options.name = site.root.string();
  const auto is_answered = [](const WebServer& server) {
    return status_of(raw_answer(server.port(), request("GET /"))) == 200;
  };
  int port = 0;
  {
    WebServer server({site.root}, options), beside({site.root}, options);
    server.start();
    port = server.port();
    beside.start();
    EXPECT_NE(beside.port(), port) << "it is taken";
    EXPECT_TRUE(is_answered(server) && is_answered(beside));
  }
  WebServer later({site.root}, options);
  later.start();
  EXPECT_EQ(later.port(), port);
  EXPECT_TRUE(is_answered(later));
}

TEST(WebServer, TheFeedIsReadAndSteered) {
  LiveFeed feed("train");
  feed.picture("v.ours", "jpeg");
  WebServer server({}, {}, &feed);
  server.start();
  httplib::Client client("127.0.0.1", server.port());
  EXPECT_EQ(nlohmann::json::parse(client.Get("/live/state")->body).at("title"), "train");
  EXPECT_EQ(client.Get("/live/pictures/v.ours")->body, "jpeg");
  EXPECT_EQ(client.Get("/live/pictures/w.ours")->status, 404);
  const httplib::Headers ours{{"X-Cnerf", "1"}};
  EXPECT_EQ(client.Post("/live/control", R"({"action":"pause"})", "application/json")->status, 403)
      << "another site can post, but not with our header";
  EXPECT_EQ(client.Post("/live/control", ours, "{}", "application/json")->status, 400);
  EXPECT_EQ(client.Post("/live/control", ours, R"({"action":"fly"})", "application/json")->status, 400);
  EXPECT_EQ(client.Post("/live/control", ours, R"({"action":"pause"})", "application/json")->status, 200);
  EXPECT_TRUE(nlohmann::json::parse(feed.state()).at("paused"));
  EXPECT_EQ(client.Post("/live/control", ours, R"({"action":"stop"})", "application/json")->status, 200);
  EXPECT_TRUE(feed.stop_requested());
}

TEST(WebServer, EventsFollowTheFeed) {
  LiveFeed feed("train");
  WebServer server({}, {}, &feed);
  server.start();
  httplib::Client client("127.0.0.1", server.port());
  std::string heard;
  std::thread work([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    feed.progress({"stage 1", 0.75, {}});
  });
  (void)client.Get("/live/events", [&](const char* data, std::size_t size) {
    heard.append(data, size);
    return heard.find("0.75") == std::string::npos;  // false ends it
  });
  work.join();
  EXPECT_TRUE(heard.starts_with("data: {"));
  EXPECT_NE(heard.find("\"fraction\":0.75"), std::string::npos);
}

}  // namespace
}  // namespace cnerf::web
