#include "tests/mutants/server_campaign.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <thread>

#include "src/base/error.h"
#include "src/base/files.h"
#include "tests/mutants/mutate.h"
#include "tests/mutants/originals.h"
#include "tests/mutants/running_program.h"

namespace cnerf::mutants {
namespace {
namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr const char* kSecret = "this lies outside of the bundle 7f3a";
constexpr int kClientThreads = 8;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

// ---- a client -------------------------------------------------------------------------------------------------------

/// A TCP connection to the server.
class Client {
 public:
  explicit Client(int port) : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(std::uint16_t(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    (void)::connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address);
  }
  ~Client() { ::close(socket_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  /// What fits into the socket's buffer, once it is connected.
  void say(const std::string& text, milliseconds patience = milliseconds(2000)) const {
    std::size_t done = 0;
    while (done < text.size() && is_ready(POLLOUT, patience)) {
      const ssize_t sent = ::send(socket_, text.data() + done, text.size() - done, MSG_NOSIGNAL);
      if (sent <= 0) return;
      done += std::size_t(sent);
    }
  }
  /// Goes with a reset, not with an end.
  void abort() const {
    const linger now{1, 0};
    ::setsockopt(socket_, SOL_SOCKET, SO_LINGER, &now, sizeof now);
  }
  /// All it says until it closes, falls silent for `patience`, or has said `most` bytes.
  [[nodiscard]] std::string answer(milliseconds patience, std::size_t most = std::size_t(8) << 20) const {
    std::string text;
    std::array<char, 65536> block;
    while (text.size() < most && is_ready(POLLIN, patience)) {
      const ssize_t got = ::recv(socket_, block.data(), block.size(), 0);
      if (got <= 0) break;
      text.append(block.data(), std::size_t(got));
    }
    return text;
  }

 private:
  [[nodiscard]] bool is_ready(short events, milliseconds patience) const {
    pollfd one{socket_, events, 0};
    return ::poll(&one, 1, int(patience.count())) > 0;
  }
  int socket_;
};

std::string ask(int port, const std::string& bytes, milliseconds patience = milliseconds(3000)) {
  const Client client(port);
  client.say(bytes);
  return client.answer(patience);
}

std::string get(const std::string& path, const std::string& more = "") {
  return "GET " + path + " HTTP/1.1\r\nHost: 127.0.0.1\r\n" + more + "Connection: close\r\n\r\n";
}

int status_of(const std::string& answer) {
  return answer.size() > 12 && answer.starts_with("HTTP/") ? std::atoi(answer.c_str() + 9) : 0;
}

std::string body_of(const std::string& answer) {
  const std::size_t end = answer.find("\r\n\r\n");
  return end == std::string::npos ? "" : answer.substr(end + 4);
}

void count(ServerRow& row, const std::string& answer) {
  const int status = status_of(answer);
  ++row.clients;
  ++(status == 0 ? row.unanswered : status < 400 ? row.served : row.refused);
  if (answer.find(kSecret) != std::string::npos || answer.find("root:x:0") != std::string::npos) ++row.leaks;
}

// ---- the server and who looks at it ---------------------------------------------------------------------------------

/// Asks for the page all the time.
class Visitor {
 public:
  Visitor(int port, double patience) : thread_([this, port, patience] { visit(port, patience); }) {}
  ~Visitor() { stop(); }
  Visitor(const Visitor&) = delete;
  Visitor& operator=(const Visitor&) = delete;

  void stop() {
    is_stopped_ = true;
    if (thread_.joinable()) thread_.join();
  }
  void tell(ServerRow& row) const {
    row.visits = visits_;
    row.failed_visits = failed_;
    row.first_failure = first_failure_;
    row.slowest_visit = slowest_;
  }

 private:
  void visit(int port, double patience) {
    while (!is_stopped_) {
      const auto begin = Clock::now();
      const std::string answer = ask(port, get("/"), milliseconds(int(4000 * patience)));
      const double seconds = seconds_since(begin);
      ++visits_;
      if (status_of(answer) != 200 || seconds > patience) {
        if (++failed_ == 1) {
          first_failure_ = fmt::format("visit {} took {:.3f} s and got {}", visits_, seconds,
                                       answer.empty() ? "nothing" : answer.substr(0, answer.find('\r')));
        }
      }
      slowest_ = std::max(slowest_, seconds);
      std::this_thread::sleep_for(milliseconds(20));
    }
  }

  std::atomic<bool> is_stopped_ = false;
  std::size_t visits_ = 0, failed_ = 0;
  double slowest_ = 0;
  std::string first_failure_;
  std::thread thread_;
};

/// A cnerf that serves.
class Server {
 public:
  Server(const ServerOptions& options, const std::string& name, std::vector<std::string> arguments)
      : options_(options),
        program_(with_program(options.program, std::move(arguments)), options.folder / (name + ".txt")) {
    constexpr const char* kBefore = "http://127.0.0.1:";
    for (int look = 0; look < 6000 && port_ == 0; ++look) {
      const std::string text = program_.printed();
      const std::size_t at = text.find(kBefore);
      if (at != std::string::npos && text.find('/', at + std::string(kBefore).size()) != std::string::npos) {
        port_ = std::atoi(text.c_str() + at + std::string(kBefore).size());
      }
      if (!program_.is_alive()) throw DeviceError(options.program.string() + " does not serve: " + text);
      std::this_thread::sleep_for(milliseconds(10));
    }
    for (int i = 0; i < 40; ++i) (void)ask(port_, get("/"));  // what it holds from its first visitors on
    settle();
  }

  /// Calls `trouble` while somebody visits.
  ServerRow run(const std::string& part, const std::function<void(int port, ServerRow&)>& trouble) {
    ServerRow row;
    row.part = part;
    const std::size_t held = program_.resident_bytes();
    row.descriptors_before = program_.open_descriptors();
    Visitor visitor(port_, options_.patience);
    Watch watch(program_);
    trouble(port_, row);
    visitor.stop();
    visitor.tell(row);
    const std::size_t most = watch.most();
    row.growth = most > held ? most - held : 0;
    for (int look = 0; look < 400 && program_.open_descriptors() > row.descriptors_before; ++look) {
      std::this_thread::sleep_for(milliseconds(100));
    }
    row.descriptors_after = program_.open_descriptors();
    judge(row);
    options_.say(fmt::format("{}: {} clients, slowest visit {:.2f} s", part, row.clients, row.slowest_visit));
    return row;
  }

  std::optional<int> end() { return program_.interrupt(std::chrono::seconds(20)); }

 private:
  /// How much the server holds meanwhile.
  class Watch {
   public:
    explicit Watch(const RunningProgram& program)
        : thread_([this, &program] {
            while (!is_stopped_) {
              most_ = std::max(most_, program.resident_bytes());
              std::this_thread::sleep_for(milliseconds(20));
            }
          }) {}
    std::size_t most() {
      is_stopped_ = true;
      thread_.join();
      return most_;
    }

   private:
    std::atomic<bool> is_stopped_ = false;
    std::size_t most_ = 0;
    std::thread thread_;
  };

  static std::vector<std::string> with_program(const fs::path& program, std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), program.string());
    return arguments;
  }

  void settle() const { std::this_thread::sleep_for(milliseconds(300)); }

  void judge(ServerRow& row) {
    const auto violated = [&](bool is_violated, const std::string& what) {
      if (is_violated) row.violations.push_back(row.part + ": " + what);
    };
    violated(!program_.is_alive(), "the server ended: " + program_.printed());
    violated(row.leaks > 0, fmt::format("{} answers hold what lies outside", row.leaks));
    violated(row.wrong > 0, fmt::format("{} answers should not have been given", row.wrong));
    violated(row.failed_visits > 0,
             fmt::format("{} of {} visits of the page failed or took more than {} s, the slowest {:.2f} s: {}",
                         row.failed_visits, row.visits, options_.patience, row.slowest_visit, row.first_failure));
    violated(!options_.limits.sanitized && row.growth > options_.most_growth,
             fmt::format("the server grew by {} MiB", row.growth >> 20));
    violated(row.descriptors_after > row.descriptors_before,
             fmt::format("{} descriptors were open before, {} after", row.descriptors_before, row.descriptors_after));
  }

  const ServerOptions& options_;
  RunningProgram program_;
  int port_ = 0;
};

/// Calls `one(i)` for i below `count`, several at a time.
void for_each_client(int count, const std::function<void(int)>& one) {
  std::atomic<int> next = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < kClientThreads; ++i) {
    threads.emplace_back([&] {
      for (int client; (client = next++) < count;) one(client);
    });
  }
  for (std::thread& thread : threads) thread.join();
}

// ---- what is done to it ---------------------------------------------------------------------------------------------

const std::vector<std::string> kTraversals = {"/../secret.txt",
                                              "/../../secret.txt",
                                              "/photos/../../secret.txt",
                                              "/%2e%2e/secret.txt",
                                              "/%2E%2E/secret.txt",
                                              "/..%2fsecret.txt",
                                              "/..%2Fsecret.txt",
                                              "/%2e%2e%2fsecret.txt",
                                              "/%252e%252e%252fsecret.txt",
                                              "/..\\secret.txt",
                                              "/..%5csecret.txt",
                                              "/%2e%2e%5csecret.txt",
                                              "/....//secret.txt",
                                              "/...//secret.txt",
                                              "/.%2e/secret.txt",
                                              "/./../secret.txt",
                                              "/photos/%2e%2e/%2e%2e/secret.txt",
                                              "/photos/..%2f..%2fsecret.txt",
                                              "//../secret.txt",
                                              "///secret.txt",
                                              "//etc/passwd",
                                              "/etc/passwd",
                                              "/../../../../../../../../etc/passwd",
                                              "/%2e%2e/%2e%2e/%2e%2e/%2e%2e/%2e%2e/%2e%2e/etc/passwd",
                                              "/..%c0%af..%c0%afetc/passwd",
                                              "/%c0%ae%c0%ae/secret.txt",
                                              "/..%00/secret.txt",
                                              "/index.html%00/../../secret.txt",
                                              "/link.txt",
                                              "/up/secret.txt",
                                              "/up/../secret.txt",
                                              "/index.html/../../secret.txt",
                                              "/?/../../secret.txt",
                                              "/#/../../secret.txt",
                                              "http://127.0.0.1/../secret.txt",
                                              "file:///etc/passwd",
                                              "/.hidden"};

const std::vector<std::string> kForeignHosts = {"evil.example",
                                                "evil.example:80",
                                                "127.attacker.example",
                                                "127.0.0.1.example",
                                                "127.0.0.1@evil.example",
                                                "localhost.example",
                                                "128.0.0.1",
                                                "0x7f.1.example",
                                                "[::2]",
                                                "[::1",
                                                "[::1]x",
                                                "127.0.0.1:80x",
                                                "10.0.0.1:80",
                                                "",
                                                " ",
                                                "127.0.0.1, evil.example",
                                                "xn--localhost-.example",
                                                "localhost:80:80",
                                                "[::ffff:10.0.0.1]",
                                                "2130706433.example"};

void try_traversals(int port, ServerRow& row) {
  for (const std::string& path : kTraversals) count(row, ask(port, get(path)));
}

void try_foreign_names(int port, ServerRow& row) {
  for (const std::string& host : kForeignHosts) {
    const std::string answer = ask(port, "GET / HTTP/1.1\r\nHost: " + host + "\r\nConnection: close\r\n\r\n");
    count(row, answer);
    row.wrong += status_of(answer) < 400 && status_of(answer) != 0 ? 1 : 0;
  }
  const std::string twice = ask(port, get("/", "Host: evil.example\r\n")), none = ask(port, "GET / HTTP/1.1\r\n\r\n");
  for (const std::string& answer : {twice, none}) {
    count(row, answer);
    row.wrong += status_of(answer) == 200 ? 1 : 0;
  }
}

/// Orders to a training that come from other pages.
void try_foreign_orders(int port, ServerRow& row) {
  const auto order = [&](const std::string& host, const std::string& headers) {
    const std::string answer = ask(port, "POST /live/control HTTP/1.1\r\nHost: " + host + "\r\n" + headers +
                                             "Connection: close\r\nContent-Length: 17\r\n\r\n{\"action\":\"stop\"}");
    count(row, answer);
    row.wrong += status_of(answer) < 400 && status_of(answer) != 0 ? 1 : 0;
  };
  const std::string own = "127.0.0.1:" + std::to_string(port);
  for (const char* origin :
       {"http://evil.example", "null", "https://127.0.0.1", "http://127.0.0.1:1", "http://localhost", "file://",
        "http://127.0.0.1.evil.example", "http://evil.example:80"}) {
    order(own, std::string("X-Cnerf: 1\r\nOrigin: ") + origin + "\r\n");
  }
  order(own, "");
  order(own, "X-Cnerf: 0\r\n");
  order(own, "Origin: http://" + own + "\r\n");
  for (const std::string& host : kForeignHosts) order(host, "X-Cnerf: 1\r\nOrigin: http://" + host + "\r\n");
}

/// Sockets that are open for a while, and say a byte a second, or nothing.
void hold_open(int port, ServerRow& row, int clients, int seconds, const std::string& says) {
  std::vector<std::unique_ptr<Client>> open;
  for (int i = 0; i < clients; ++i) open.push_back(std::make_unique<Client>(port));
  for (int second = 0; second < seconds; ++second) {
    const auto begin = Clock::now();
    for (const auto& client : open) {
      if (!says.empty()) client->say(says.substr(std::size_t(second) % says.size(), 1), milliseconds(0));
    }
    std::this_thread::sleep_until(begin + std::chrono::seconds(1));
  }
  row.clients = open.size();
  row.unanswered = open.size();
}

void follow(int port, ServerRow& row, int clients, int seconds) {
  std::vector<std::unique_ptr<Client>> open;
  for (int i = 0; i < clients; ++i) {
    open.push_back(std::make_unique<Client>(port));
    open.back()->say("GET /live/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", milliseconds(100));
  }
  std::this_thread::sleep_for(std::chrono::seconds(seconds));
  for (const auto& client : open) count(row, client->answer(milliseconds(1), 4096));
}

void try_ranges(int port, ServerRow& row, const fs::path& bundle) {
  std::string many = "0-", apart = "0-0";
  for (int i = 0; i < 1500; ++i) {
    many += ",0-";
    apart += fmt::format(",{0}-{0}", 2 * i);
  }
  const std::vector<std::string> ranges = {"bytes=" + many,
                                           "bytes=" + apart,
                                           "bytes=0-",
                                           "bytes=-1",
                                           "bytes=-0",
                                           "bytes=5-2",
                                           "bytes=0-99999999999999999999",
                                           "bytes=18446744073709551615-",
                                           "bytes=-18446744073709551615",
                                           "bytes=9223372036854775808-9223372036854775809",
                                           "bytes=",
                                           "bytes=-",
                                           "bytes=a-b",
                                           "bytes=1-2-3",
                                           "bits=0-1",
                                           "bytes=0-1,",
                                           "bytes=,",
                                           "bytes= 0-1",
                                           "bytes=0x1-0x2",
                                           "bytes=-9999",
                                           "bytes=99999999-",
                                           "bytes=+1-2",
                                           "bytes=1e3-2e3",
                                           ""};
  for (const auto& entry : fs::recursive_directory_iterator(bundle)) {
    if (!entry.is_regular_file() || entry.is_symlink()) continue;
    const std::string path = "/" + fs::relative(entry.path(), bundle).generic_string();
    for (const std::string& range : ranges) {
      const std::string answer = ask(port, get(path, "Range: " + range + "\r\n"));
      count(row, answer);
      // With a page of the program's own in front the bundle's index.html is not what is served.
      const bool is_longer = body_of(answer).size() > entry.file_size() && status_of(answer) < 400;
      row.wrong += is_longer && path != "/index.html" ? 1 : 0;
    }
  }
}

void try_aborts(int port, ServerRow& row, int clients, const std::string& file) {
  std::mutex mutex;
  for_each_client(clients, [&](int i) {
    const Client client(port);
    client.say(get(file));
    std::string answer;
    if (i % 3 != 0) answer = client.answer(milliseconds(200), 1);
    if (i % 2 == 0) client.abort();
    const std::lock_guard guard(mutex);
    count(row, answer);
  });
}

void send_garbage(int port, ServerRow& row, const ServerOptions& options) {
  // NOLINTBEGIN(bugprone-suspicious-missing-comma): long ones go on in the next line
  const std::vector<std::string> requests = {
      get("/"),
      get("/bundle.json", "Range: bytes=0-9\r\nAccept-Encoding: gzip\r\n"),
      "POST /live/control HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Cnerf: 1\r\nContent-Length: 18\r\nConnection: "
      "close\r\n\r\n{\"action\":\"pause\"}",
      "POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked\r\nConnection: "
      "close\r\n\r\n4\r\nabcd\r\n0\r\n\r\n",
      "POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: multipart/form-data; boundary=a\r\nContent-Length: "
      "60\r\nConnection: close\r\n\r\n--a\r\nContent-Disposition: form-data; name=\"b\"\r\n\r\nc\r\n--a--\r\n",
      "HEAD /../secret.txt HTTP/1.0\r\nHost: 127.0.0.1\r\nCookie: cnerf_token=a\r\n\r\n",
      get("/live/events?token=abc&x=%41"),
      get("/photos/%2e%2e/secret.txt", "If-Range: a\r\nExpect: 100-continue\r\n")};
  // NOLINTEND(bugprone-suspicious-missing-comma)
  std::mutex mutex;
  for_each_client(options.garbage, [&](int i) {
    Random random(options.seed, "garbage", std::size_t(i));
    Mutant request{random.of(requests), ""};
    for (std::size_t n = 1 + random.below(3); n > 0 && !request.bytes.empty(); --n) {
      request = random.chance(3) ? mutate_text(request.bytes, random) : mutate_bytes(request.bytes, random);
    }
    const Client client(port);
    client.say(request.bytes, milliseconds(200));
    const std::string answer = client.answer(milliseconds(150), 1 << 20);  // most that is cut short has none
    const std::lock_guard guard(mutex);
    count(row, answer);
  });
}

/// As many sockets as the campaign has clients.
void allow_descriptors() {
  rlimit limit{};
  ::getrlimit(RLIMIT_NOFILE, &limit);
  limit.rlim_cur = std::min<rlim_t>(limit.rlim_max, 8192);
  ::setrlimit(RLIMIT_NOFILE, &limit);
}

/// What must not be served lies beside the bundle, and links lead to it.
void lay_secrets(const fs::path& bundle) {
  const fs::path secret = bundle.parent_path() / "secret.txt";
  write_file(secret, std::string(kSecret));
  write_file(bundle / ".hidden", std::string(kSecret));
  fs::remove(bundle / "link.txt");
  fs::remove(bundle / "up");
  fs::create_symlink(secret, bundle / "link.txt");
  fs::create_directory_symlink(bundle.parent_path(), bundle / "up");
}

std::vector<std::string> endless_training(const fs::path& capture, const fs::path& run) {
  std::vector<std::string> words = {"train",       capture.string(), "-o", run.string(), "--view", "--no-browser",
                                    "--overwrite", "--threads",      "1",  "--device",   "cpu"};
  const std::vector<std::string> options = least_options();
  words.insert(words.end(), options.begin(), options.end());
  words.insert(words.end(), {"--set", "stage1.steps=1000000", "--set", "stage1.checkpoint_every=1000000"});
  return words;
}

}  // namespace

std::vector<ServerRow> run_server_campaign(const ServerOptions& options) {
  const Workshop workshop{options.program, options.folder / "served", options.limits};
  fs::remove_all(options.folder);
  fs::create_directories(options.folder);
  write_file(options.folder / "page/index.html", "<!doctype html><title>page</title>");
  ::setenv("CNERF_PAGE", (options.folder / "page").c_str(), 1);
  const fs::path bundle = make_bundle(workshop);
  lay_secrets(bundle);
  std::string photo = "/bundle.json";
  if (fs::exists(bundle / "density.bin")) photo = "/density.bin";

  std::vector<ServerRow> rows;
  {
    Server server(options, "view", {"view", bundle.string(), "--no-browser"});
    allow_descriptors();  // ours; a server has what its user has
    rows.push_back(server.run("path traversals", try_traversals));
    rows.push_back(server.run("foreign Host", try_foreign_names));
    rows.push_back(server.run("ranges", [&](int port, ServerRow& row) { try_ranges(port, row, bundle); }));
    rows.push_back(
        server.run("aborts", [&](int port, ServerRow& row) { try_aborts(port, row, options.aborts, photo); }));
    rows.push_back(server.run("garbage", [&](int port, ServerRow& row) { send_garbage(port, row, options); }));
    rows.push_back(server.run("slow sockets", [&](int port, ServerRow& row) {
      hold_open(port, row, options.slow, options.seconds,
                "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: aaaaaaaaaaaaaaaaaaaa");
    }));
    rows.push_back(server.run("silent sockets", [&](int port, ServerRow& row) {
      hold_open(port, row, options.silent, options.seconds, "");
    }));
    const auto status = server.end();
    if (status != 0) rows.back().violations.push_back(fmt::format("view: ended with {}", status.value_or(-1)));
  }
  Server training(options, "train", endless_training(workshop.folder / "capture", options.folder / "followed"));
  rows.push_back(training.run("orders from other pages", try_foreign_orders));
  rows.push_back(training.run("event streams",
                              [&](int port, ServerRow& row) { follow(port, row, options.streams, options.seconds); }));
  const auto status = training.end();
  if (status != 130) rows.back().violations.push_back(fmt::format("training: ended with {}", status.value_or(-1)));
  return rows;
}

std::string table_of(const std::vector<ServerRow>& rows) {
  std::string table =
      "| part | clients | served | refused | no answer | leaks | wrong | visits of / | failed | slowest, s | growth, "
      "MiB | descriptors |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|\n";
  for (const ServerRow& row : rows) {
    table += fmt::format("| {} | {} | {} | {} | {} | {} | {} | {} | {} | {:.2f} | {:.1f} | {} -> {} |\n", row.part,
                         row.clients, row.served, row.refused, row.unanswered, row.leaks, row.wrong, row.visits,
                         row.failed_visits, row.slowest_visit, double(row.growth) / (1 << 20), row.descriptors_before,
                         row.descriptors_after);
  }
  return table;
}

}  // namespace cnerf::mutants
