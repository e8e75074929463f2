/// Requests to the viewer's server, over a connection of its own each: with a token or without by the first byte.

#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <arpa/inet.h>

#include <array>
#include <optional>

#include "src/base/process.h"
#include "tests/fuzz/fuzz_target.h"
#include "viewer/server/web_server.h"

namespace {

using namespace cnerf;

constexpr const char* kSecret = "nobody may see this";
constexpr const char* kToken = "0123456789abcdef";

/// A server that lives as long as the process, and what lies beside its folder.
class Server {
 public:
  explicit Server(const std::string& token) : feed_("fuzz"), server_({folder()}, {"127.0.0.1", 0, token}, &feed_) {
    feed_.picture("one.jpg", "no picture");
    server_.start();
  }
  [[nodiscard]] int port() const { return server_.port(); }

 private:
  static std::filesystem::path folder() {
    (void)fuzz::scratch_file("secret.txt", fuzz::bytes_of(kSecret));
    (void)fuzz::scratch_file("served/.hidden", fuzz::bytes_of(kSecret));
    (void)fuzz::scratch_file("served/data.bin", fuzz::bytes_of("0123456789"));
    return fuzz::scratch_file("served/index.html", fuzz::bytes_of("<html>page</html>")).parent_path();
  }

  web::LiveFeed feed_;
  web::WebServer server_;
};

/// All that the server says, until it closes the connection or falls silent.
std::string answer_of(int port, fuzz::Bytes request) {
  constexpr int kSilence = 300;  // milliseconds; an answer that follows the work does not end by itself
  const FileDescriptor client(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(std::uint16_t(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (::connect(client.number(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    throw fuzz::Finding("the server takes no connection any more");
  }
  const linger at_once{1, 0};  // no port waits for its end: there are only so many
  ::setsockopt(client.number(), SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
  (void)::send(client.number(), request.data(), request.size(), MSG_NOSIGNAL);
  ::shutdown(client.number(), SHUT_WR);
  std::string answer;
  std::array<char, 4096> piece;
  for (pollfd waiting{client.number(), POLLIN, 0}; ::poll(&waiting, 1, kSilence) > 0;) {
    const ::ssize_t got = ::recv(client.number(), piece.data(), piece.size(), 0);
    if (got <= 0 || answer.size() > 1'000'000) break;
    answer.append(piece.data(), std::size_t(got));
  }
  return answer;
}

}  // namespace

CNERF_FUZZ_TARGET(http) {
  const bool has_token = fuzz::take_byte(input) % 2 == 1;
  static Server open(""), closed(kToken);
  const std::string answer =
      answer_of(has_token ? closed.port() : open.port(), input.first(std::min<std::size_t>(input.size(), 60'000)));
  if (!answer.empty() && !answer.starts_with("HTTP/1."))
    throw fuzz::Finding("no answer of HTTP: " + answer.substr(0, 80));
  if (answer.find(kSecret) != answer.npos) throw fuzz::Finding("a file was served that is none of the server's");
  const bool knows_token = fuzz::text_of(input).find(kToken) != std::string::npos;
  if (has_token && !knows_token && answer.find("<html>page") != answer.npos) {
    throw fuzz::Finding("a visitor without the token got in");
  }
}
