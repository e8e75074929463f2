#pragma once
/// A small web server for looking at bundles and at running work: files of a few folders, and a live feed.

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "viewer/server/live_feed.h"
#include "viewer/server/page_api.h"

namespace cnerf::web {

struct WebServerOptions {
  std::string host = "127.0.0.1";
  int port = 0;       ///< 0 = a free one
  std::string token;  ///< what a visitor must know; needed unless `host` is this machine's loopback
  /// Of what is shown. Where `port` is 0, servers of one name have the same one if it is free: by the address, a
  /// browser keeps what a page had not saved.
  std::string name = {};
};

/// @throws UsageError  when a host other than the loopback has no token of at least 16 letters, digits, - or _.
void check_web_server_options(const WebServerOptions& options);
/// A token nobody guesses: 32 letters and digits.
[[nodiscard]] std::string random_token();

/// Serves GET and HEAD of the files below its folders; the first folder that has a file wins. A path, or a link, that
/// leads out of the folders does not exist. Other methods, bodies beyond 4 KiB, addresses beyond 8 KiB, names of other
/// hosts (DNS rebinding) and requests of other sites' pages, which may only link here, are refused. Files are sent
/// piece by piece, one part of each at most. A request has to be whole within 10 seconds and one for every 16 KiB, and
/// a client that keeps us waiting goes when others want its place. With a token, a visitor comes with `?token=…`, which
/// becomes a cookie of a name of its own.
///
/// With a feed also: GET /live/state, GET /live/events (server-sent events, at most 8 at a time),
/// GET /live/pictures/NAME, and POST /live/control with the header `X-Cnerf: 1`, which no other site can send, and no
/// `Origin` but the server's own.
///
/// With a page API also what that answers below its prefix: GET as files, PUT and POST as /live/control, with bodies as
/// large as it says.
class WebServer {
 public:
  /// @param feed, api  may be null; must outlive the server.
  WebServer(std::vector<std::filesystem::path> folders, const WebServerOptions& options, LiveFeed* feed = nullptr,
            PageApi* api = nullptr);
  /// Stops.
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  /// Binds and answers from now on, in threads of its own.
  /// @throws DeviceError  when the address cannot be had, e.g. because the port is in use.
  void start();
  void stop();
  /// To open in a browser, with the token if there is one: "http://127.0.0.1:41873/".
  [[nodiscard]] std::string address() const;
  [[nodiscard]] int port() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Opens an address in the user's browser, where there is a desktop. @return whether something was started.
bool open_browser(const std::string& address);

}  // namespace cnerf::web
