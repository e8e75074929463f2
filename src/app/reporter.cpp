#include "src/app/reporter.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "src/base/error.h"
#include "src/base/text.h"

namespace cnerf::app {
namespace {

using Json = nlohmann::ordered_json;
using Seconds = std::chrono::duration<double>;

/// Time between two lines; the last line of a task is always shown.
Seconds interval_of(ProgressStyle style) {
  switch (style) {
    case ProgressStyle::kLine:
      return Seconds(0.1);
    case ProgressStyle::kJson:
      return Seconds(0.5);
    default:
      return Seconds(10);
  }
}

/// 27.13, 0.0012, 213k
std::string figure_text(double value) {
  if (std::abs(value) >= 1e6) return fmt::format("{:.2f}M", value / 1e6);
  if (std::abs(value) >= 1e4) return fmt::format("{:.0f}k", value / 1e3);
  return fmt::format("{:.4g}", value);
}

/// Names of files need not be in UTF-8.
std::string json_text(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

ProgressStyle progress_style(const std::string& name, std::FILE* out) {
  if (name == "auto") return ::isatty(::fileno(out)) != 0 ? ProgressStyle::kLine : ProgressStyle::kPlain;
  if (name == "line") return ProgressStyle::kLine;
  if (name == "plain") return ProgressStyle::kPlain;
  if (name == "json") return ProgressStyle::kJson;
  if (name == "quiet") return ProgressStyle::kQuiet;
  throw UsageError("--progress: expected auto, line, plain, json or quiet, got '" + name + "'");
}

void Reporter::report_progress(const Progress& progress) {
  if (style_ == ProgressStyle::kQuiet || style_ == ProgressStyle::kSilent) return;
  const auto now = Clock::now();
  const bool is_new = progress.task != task_ || progress.fraction < start_fraction_;
  if (is_new) {
    end_line();
    task_ = progress.task;
    start_ = now;
    start_fraction_ = progress.fraction;
  }
  const bool finished = progress.fraction >= 1;
  if (!is_new && !finished && now - last_shown_ < interval_of(style_)) return;
  last_shown_ = now;
  print_progress(progress, remaining_seconds(progress));
  if (finished) end_line();
}

double Reporter::remaining_seconds(const Progress& progress) const {
  const double done = progress.fraction - start_fraction_;
  if (done <= 0) return -1;
  return Seconds(Clock::now() - start_).count() * (1 - progress.fraction) / done;
}

void Reporter::print_progress(const Progress& progress, double remaining) {
  if (style_ == ProgressStyle::kJson) {
    Json json{{"event", "progress"}, {"task", progress.task}, {"fraction", progress.fraction}};
    for (const auto& [name, value] : progress.figures) {
      json["figures"][name] = std::isfinite(value) ? Json(value) : Json();
    }
    if (remaining >= 0) json["remaining_seconds"] = remaining;
    return print_line(json_text(json));
  }
  std::string text = fmt::format("{} {:3.0f} %", progress.task, 100 * progress.fraction);
  for (const auto& [name, value] : progress.figures) text += fmt::format("  {} {}", name, figure_text(value));
  if (remaining >= 0 && progress.fraction < 1) text += "  " + duration_text(remaining) + " left";
  if (style_ != ProgressStyle::kLine) return print_line(text);
  fmt::print(out_, "\r{}\x1b[K", text);  // K: erase what a longer line left
  std::fflush(out_);
  line_open_ = true;
}

void Reporter::end_line() {
  if (line_open_) fmt::print(out_, "\n");
  line_open_ = false;
}

void Reporter::print_line(const std::string& line) {
  end_line();
  fmt::print(out_, "{}\n", line);
  std::fflush(out_);
}

void Reporter::say(const std::string& text) {
  if (style_ == ProgressStyle::kJson) return print_line(json_text({{"event", "message"}, {"text", text}}));
  if (style_ == ProgressStyle::kQuiet || style_ == ProgressStyle::kSilent) return;
  print_line(text);
}

void Reporter::wrote(const std::string& what, const std::filesystem::path& path) {
  if (style_ == ProgressStyle::kSilent) return;
  if (style_ == ProgressStyle::kJson) {
    return print_line(json_text({{"event", "wrote"}, {"what", what}, {"path", path.string()}}));
  }
  print_line(fmt::format("{:<18} {}", what + ":", path.string()));
}

void Reporter::next(const std::string& text) {
  if (style_ == ProgressStyle::kJson) return print_line(json_text({{"event", "next"}, {"text", text}}));
  if (style_ == ProgressStyle::kQuiet || style_ == ProgressStyle::kSilent) return;
  print_line(fmt::format("{:<18} {}", "next:", text));
}

}  // namespace cnerf::app
