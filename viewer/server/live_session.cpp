#include "viewer/server/live_session.h"

#include <algorithm>
#include <cctype>
#include <exception>
#include <thread>

#include "src/base/files.h"
#include "src/base/usage.h"
#include "src/picture/encode.h"
#include "viewer/server/page_folder.h"

namespace cnerf::web {
namespace {

constexpr auto kBetweenReports = std::chrono::milliseconds(250);
constexpr double kLeastBetweenPictures = 1.5;  // seconds
constexpr int kQuality = 85;                   // of JPEG
constexpr double kPictureShare = 0.02;         // of the time, at most; reports take next to none

std::string jpeg_of(int width, int height, const std::vector<float>& linear) {
  return text_of(jpeg_bytes(picture_from_linear(width, height, linear), kQuality));
}

/// "images/view 1.png" -> "images_view_1"
std::string plain_name(const std::string& name) {
  std::string plain = name.substr(0, name.rfind('.'));
  for (char& c : plain) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '-') c = '_';
  }
  return plain.size() > 60 ? plain.substr(plain.size() - 60) : plain;
}

}  // namespace

LiveSession::LiveSession(const std::string& title, const BrowserOptions& options, Observer& inner)
    : inner_(inner), feed_(title), server_({find_page()}, options.server, &feed_) {
  server_.start();
  inner_.say("view: " + server_.address());
  if (find_page().empty()) inner_.say("note: this cnerf was built without the page; the address serves data only");
  if (!options.no_browser && options.server.token.empty()) open_browser(server_.address());
}

LiveSession::~LiveSession() {
  feed_.say(is_cancelled()                   ? "Stopped and saved. The same command with --resume goes on."
            : std::uncaught_exceptions() > 0 ? "Ended with an error; the terminal says which."
                                             : "Finished.",
            true);
  std::this_thread::sleep_for(std::chrono::milliseconds(700));  // so that tabs hear it
}

void LiveSession::report_progress(const Progress& progress) {
  inner_.report_progress(progress);
  const auto now = Clock::now();
  const bool is_new = progress.task != task_;
  if (is_new || progress.fraction >= 1 || now - last_shown_ >= kBetweenReports) {
    task_ = progress.task;
    last_shown_ = now;
    feed_.progress(progress);
  }
  feed_.wait_while_paused();
}

void LiveSession::offer_preview(const DrawPreview& draw) {
  if (Clock::now() < next_picture_) return;
  const Stopwatch watch;
  show(draw(drawn_++));
  const double pause = std::max(kLeastBetweenPictures, watch.seconds() / kPictureShare);
  next_picture_ = Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(pause));
}

void LiveSession::show(const PreviewPicture& picture) {
  const std::string name = plain_name(picture.name);
  if (!feed_.picture(name + ".input")) {
    feed_.picture(name + ".input", jpeg_of(picture.width, picture.height, picture.input));
  }
  feed_.picture(name + ".ours", jpeg_of(picture.width, picture.height, picture.ours));
}

}  // namespace cnerf::web
