#pragma once
/// `--view`: what a running command shows in the browser.

#include <chrono>
#include <cstddef>
#include <string>

#include "src/base/observer.h"
#include "viewer/server/live_feed.h"
#include "viewer/server/web_server.h"

namespace cnerf::web {

/// Options of everything that opens the browser.
struct BrowserOptions {
  WebServerOptions server;
  bool no_browser = false;  ///< nor where there is a token: others would see it among the browser's arguments
};

/// Serves a command's progress from its construction to its end. Looking costs at most 3 % of the time: pictures are
/// drawn when the time since the last one is 50 times what it took.
class LiveSession final : public Observer {
 public:
  /// Says where to look, on `inner`, which hears all that this hears.  @throws UsageError, DeviceError.
  LiveSession(const std::string& title, const BrowserOptions& options, Observer& inner);
  ~LiveSession() override;
  LiveSession(const LiveSession&) = delete;
  LiveSession& operator=(const LiveSession&) = delete;

  /// Reports to the browser as well, and waits while the browser asks for a pause.
  void report_progress(const Progress& progress) override;
  void say(const std::string& text) override { inner_.say(text); }
  void wrote(const std::string& what, const std::filesystem::path& path) override { inner_.wrote(what, path); }
  /// Has pictures drawn for the browser, now and then.
  void offer_preview(const DrawPreview& draw) override;
  [[nodiscard]] bool wants_previews() const override { return true; }
  /// Also when the browser asks to stop.
  [[nodiscard]] bool is_cancelled() const override { return feed_.stop_requested() || inner_.is_cancelled(); }

 private:
  using Clock = std::chrono::steady_clock;
  void show(const PreviewPicture& picture);

  Observer& inner_;
  LiveFeed feed_;
  WebServer server_;
  std::size_t drawn_ = 0;
  Clock::time_point last_shown_{}, next_picture_{};
  std::string task_;
};

}  // namespace cnerf::web
