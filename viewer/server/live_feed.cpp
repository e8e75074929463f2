#include "viewer/server/live_feed.h"

#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>

namespace cnerf::web {
namespace {

using Json = nlohmann::ordered_json;
constexpr std::size_t kCurvePoints = 500;

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

LiveFeed::LiveFeed(std::string title) : title_(std::move(title)), begin_(now()) {}

void LiveFeed::changed() {
  ++version_;
  news_.notify_all();
}

void LiveFeed::progress(const Progress& progress) {
  const std::lock_guard lock(mutex_);
  task_ = progress.task;
  fraction_ = progress.fraction;
  figures_ = progress.figures;
  const double seconds = now() - begin_;
  for (const auto& [name, value] : progress.figures) {
    if (!std::isfinite(value)) continue;
    Curve& curve = curves_[task_ + ": " + name];
    if (curve.skipped + 1 < curve.every) {
      ++curve.skipped;
      continue;
    }
    curve.skipped = 0;
    curve.points.push_back({seconds, value});
    if (curve.points.size() < kCurvePoints) continue;
    std::vector<CurvePoint> thinned;
    for (std::size_t i = 0; i < curve.points.size(); i += 2) thinned.push_back(curve.points[i]);
    curve.points = std::move(thinned);
    curve.every *= 2;
  }
  changed();
}

void LiveFeed::picture(const std::string& name, std::string bytes) {
  const std::lock_guard lock(mutex_);
  changed();
  pictures_[name] = {version_, std::move(bytes)};
}

void LiveFeed::say(const std::string& text, bool finished) {
  const std::lock_guard lock(mutex_);
  message_ = text;
  finished_ = finished_ || finished;
  changed();
}

void LiveFeed::request_pause(bool paused) {
  const std::lock_guard lock(mutex_);
  paused_ = paused && !finished_;
  changed();
}

void LiveFeed::request_stop() {
  const std::lock_guard lock(mutex_);
  stop_ = true;
  paused_ = false;
  changed();
}

bool LiveFeed::stop_requested() const {
  const std::lock_guard lock(mutex_);
  return stop_;
}

double LiveFeed::wait_while_paused() {
  const double begin = now();
  std::unique_lock lock(mutex_);
  // Ctrl-C only sets a flag: it has to be looked for.
  while (paused_ && !stop_ && !closed_ && !interruption_requested())
    news_.wait_for(lock, std::chrono::milliseconds(100));
  return now() - begin;
}

std::string LiveFeed::state_locked() const {
  Json json{{"version", version_},   {"title", title_},           {"task", task_},
            {"fraction", fraction_}, {"seconds", now() - begin_}, {"paused", paused_},
            {"stopping", stop_},     {"finished", finished_},     {"message", message_}};
  json["figures"] = Json::object();
  for (const auto& [name, value] : figures_) json["figures"][name] = std::isfinite(value) ? Json(value) : Json();
  json["curves"] = Json::object();
  for (const auto& [name, curve] : curves_) {
    Json points = Json::array();
    for (const CurvePoint& point : curve.points) points.push_back({std::round(point.seconds * 100) / 100, point.value});
    json["curves"][name] = points;
  }
  json["pictures"] = Json::array();
  for (const auto& [name, picture] : pictures_)
    json["pictures"].push_back({{"name", name}, {"version", picture.first}});
  return json.dump();
}

std::string LiveFeed::state() const {
  const std::lock_guard lock(mutex_);
  return state_locked();
}

std::optional<std::pair<std::uint64_t, std::string>> LiveFeed::wait_for_news(std::uint64_t after,
                                                                             double seconds) const {
  std::unique_lock lock(mutex_);
  const bool came =
      news_.wait_for(lock, std::chrono::duration<double>(seconds), [&] { return version_ != after || closed_; });
  if (!came || version_ == after) return std::nullopt;
  return std::pair{version_, state_locked()};
}

std::optional<std::string> LiveFeed::picture(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  const auto found = pictures_.find(name);
  if (found == pictures_.end()) return std::nullopt;
  return found->second.second;
}

void LiveFeed::close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  news_.notify_all();
}

bool LiveFeed::closed() const {
  const std::lock_guard lock(mutex_);
  return closed_;
}

}  // namespace cnerf::web
