// What a training in the studio loses to a page that looks at it.
//   cnerf-studio-training CAPTURE FOLDER [seconds=10] [device=auto] [downscale=N]
//     FOLDER    for runs; made anew each time
//     prints samples per second with nobody there, with a page that rests, and with one that turns the camera

#include <fmt/format.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "src/base/error.h"
#include "src/base/usage.h"
#include "src/pipeline/run_context.h"
#include "src/studio/studio.h"

namespace cnerf::studio {
namespace {
namespace fs = std::filesystem;

enum class Page { kNobody, kRests, kTurns };

std::string asked_frame(const Capture& capture, double share, bool is_moving) {
  const SceneMessage scene = scene_of(capture, "");
  const ViewMessage& view = scene.views[std::size_t(scene.home)];
  FrameMessage frame{view.camera, {"grey"}, is_moving};
  const int width = int(1280 * share), height = int(720 * share);
  const double f = view.camera.lens.fy * height / view.camera.lens.height;
  frame.camera.lens = {width, height, f, f, width / 2.0, height / 2.0};
  return json_of(frame).dump();
}

/// A page as viewer/src/studio/scheduler.ts has it: coarse frames one after another while it turns; at rest a coarse
/// one and one of twice its size whenever the colours changed.
void look(Studio& studio, const Capture& capture, Page page, const std::atomic<bool>& is_over) {
  double coarse = 1.0 / 6;
  const auto ask = [&](double share, bool is_moving) {
    const auto answer =
        studio.answer({"POST", "/studio/frame", {}, "bench", {}, asked_frame(capture, share, is_moving)});
    if (answer.status != 200) return;
    // Of the size that takes a tenth of a second.
    const double seconds = std::stod(answer.headers.back().second) / 1000 * std::pow(coarse / share, 2);
    coarse = std::clamp(coarse * std::clamp(std::sqrt(0.1 / seconds), 0.6, 1.5), 1.0 / 12, 1.0);
  };
  std::uint64_t seen = 0, colors = 0;
  while (!is_over) {
    if (page == Page::kTurns) {
      ask(coarse, true);
      continue;
    }
    const auto news = studio.wait_for_news(seen, 0.2);
    if (!news) continue;
    seen = news->first;
    const auto now = parse_json(news->second, "state").value("colors", std::uint64_t(0));
    if (std::exchange(colors, now) == now) continue;
    ask(coarse, false);
    ask(std::min(2 * coarse, 0.5), false);
  }
}

/// Samples per second of a training.
double speed(pipeline::RunContext& context, const fs::path& capture, const Engines& engines, Page page,
             double seconds) {
  Observer observer;
  pipeline::begin_run(context, capture, {.overwrite = true});
  Studio studio(context, "", engines, observer);
  std::thread worker([&] { studio.run(); });
  const auto samples = [&] {
    const auto state = parse_json(studio.answer({"GET", "/studio/state", {}, "bench", {}, {}}).body, "state");
    return state.at("figures").value("samples", 0.0);
  };
  while (samples() == 0) std::this_thread::sleep_for(std::chrono::milliseconds(20));
  std::atomic<bool> is_over = false;
  std::thread client([&] {
    if (page != Page::kNobody) look(studio, context.capture, page, is_over);
  });
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds / 4));  // until frames have found their size
  const double before = samples();
  const Stopwatch watch;
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
  const double rate = (samples() - before) / watch.seconds();
  is_over = true;
  studio.close();
  client.join();
  worker.join();
  return rate;
}

void measure(const fs::path& capture, const fs::path& folder, const Config& config, double seconds) {
  const Engines& engines = engines_for(config.device);
  Observer observer;
  pipeline::RunContext context{pipeline::RunDirectory(folder),
                               config,
                               pipeline::read_capture(capture, config, observer),
                               {"cnerf-studio-training"}};
  const double alone = speed(context, capture, engines, Page::kNobody, seconds);
  const double resting = speed(context, capture, engines, Page::kRests, seconds);
  const double turning = speed(context, capture, engines, Page::kTurns, seconds);
  const double again = speed(context, capture, engines, Page::kNobody, seconds);
  const double mean = (alone + again) / 2;
  fmt::print("{:<40} {:>10.3g} and {:.3g} samples/s\n", "nobody looks, before and after", alone, again);
  fmt::print("{:<40} {:>9.1f} % slower\n", "a page that rests", 100 * (1 - resting / mean));
  fmt::print("{:<40} {:>9.1f} % slower\n", "a page that turns", 100 * (1 - turning / mean));
}

}  // namespace
}  // namespace cnerf::studio

int main(int argc, char** argv) {
  try {
    std::filesystem::path capture, folder;
    cnerf::Config config;
    double seconds = 10;
    for (int i = 1; i < argc; ++i) {
      const std::string word = argv[i];
      const auto equals = word.find('=');
      const std::string value = equals == std::string::npos ? "" : word.substr(equals + 1);
      if (word.starts_with("seconds="))
        seconds = std::stod(value);
      else if (word.starts_with("device="))
        config.device = value;
      else if (word.starts_with("downscale="))
        config.capture.downscale = std::stoi(value);
      else
        (capture.empty() ? capture : folder) = word;
    }
    if (folder.empty()) throw cnerf::UsageError("CAPTURE FOLDER [seconds=10] [device=auto] [downscale=N]");
    config.stage1.steps = 10000000;
    cnerf::studio::measure(capture, folder, config, seconds);
    return 0;
  } catch (const std::exception& problem) {
    fmt::print(stderr, "cnerf-studio-training: {}\n", problem.what());
    return 1;
  }
}
