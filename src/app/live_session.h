#pragma once
/// `--view`: what a running command shows in the browser.

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstddef>
#include <string>

#include "src/app/reporter.h"
#include "src/base/preview.h"
#include "src/base/progress.h"
#include "viewer/server/live_feed.h"
#include "viewer/server/web_server.h"

namespace cnerf {

/// Options of everything that opens the browser.
struct BrowserArguments {
  WebServerOptions server;
  bool no_browser = false;
};
/// Declares --port, --host, --token and --no-browser.
void add_browser_options(CLI::App& app, BrowserArguments& arguments);

/// Serves a command's progress from its construction to its end. Looking costs at most 3 % of the time: pictures are
/// drawn when the time since the last one is 50 times what it took.
class LiveSession {
 public:
  /// Says where to look.  @throws UsageError, DeviceError.
  LiveSession(const std::string& title, const BrowserArguments& arguments, Reporter& reporter);
  ~LiveSession();
  LiveSession(const LiveSession&) = delete;
  LiveSession& operator=(const LiveSession&) = delete;

  /// Reports to `inner` and to the browser, waits while the browser asks for a pause, and asks for an interruption when
  /// it asks to stop. Refers to this object.
  [[nodiscard]] ProgressSink watching(ProgressSink inner);
  /// Has pictures drawn for the browser, now and then. Refers to this object.
  [[nodiscard]] PreviewSink previews();

 private:
  using Clock = std::chrono::steady_clock;
  void look(const Progress& progress);
  void show(const PreviewPicture& picture);

  LiveFeed feed_;
  WebServer server_;
  std::size_t drawn_ = 0;
  Clock::time_point last_shown_{}, next_picture_{};
  std::string task_;
};

}  // namespace cnerf
