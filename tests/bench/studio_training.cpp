// What a training in the studio loses to a page that looks at it.
//   cnerf-studio-training CAPTURE FOLDER [from=4e6] [to=24e6] [device=auto] [downscale=N]
//     FOLDER    for runs; made anew each time
//     prints how long these samples take, medians of three, with nobody there, with a page that rests, and with one
//     that turns the camera

#include <fmt/format.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "src/base/error.h"
#include "src/base/statistics.h"
#include "src/base/usage.h"
#include "src/pipeline/run_context.h"
#include "src/studio/studio.h"

namespace cnerf::studio {
namespace {
namespace fs = std::filesystem;

constexpr int kRounds = 3;

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

/// The part of a training that is timed, in samples: what is half learned is slower.
struct Part {
  double begin = 0, end = 0;
};

/// Seconds that a part of a training takes.
double timed(pipeline::RunContext& context, const fs::path& capture, const Engines& engines, Page page,
             const Part& part) {
  Observer observer;
  pipeline::begin_run(context, capture, {.overwrite = true});
  Studio studio(context, "", engines, observer);
  std::thread worker([&] { studio.run(); });
  const auto samples = [&] {
    const auto state = parse_json(studio.answer({"GET", "/studio/state", {}, "bench", {}, {}}).body, "state");
    return state.at("figures").value("samples", 0.0);
  };
  const auto wait_for = [&](double count) {
    while (samples() < count) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  };
  wait_for(1);
  std::atomic<bool> is_over = false;
  std::thread client([&] {
    if (page != Page::kNobody) look(studio, context.capture, page, is_over);
  });
  wait_for(part.begin);
  const Stopwatch watch;
  wait_for(part.end);
  const double seconds = watch.seconds();
  is_over = true;
  studio.close();
  client.join();
  worker.join();
  return seconds;
}

void measure(const fs::path& capture, const fs::path& folder, const Config& config, const Part& part) {
  const Engines& engines = engines_for(config.device);
  Observer observer;
  pipeline::RunContext context{pipeline::RunDirectory(folder),
                               config,
                               pipeline::read_capture(capture, config, observer),
                               {"cnerf-studio-training"}};
  // In turns: the machine is not equally quick all the time.
  std::vector<double> alone, resting, turning;
  for (int round = 0; round < kRounds; ++round) {
    alone.push_back(timed(context, capture, engines, Page::kNobody, part));
    resting.push_back(timed(context, capture, engines, Page::kRests, part));
    turning.push_back(timed(context, capture, engines, Page::kTurns, part));
  }
  const auto [least, most] = std::ranges::minmax(alone);
  // Of its speed, as a share.
  const auto slower = [&](const std::vector<double>& seconds) { return 100 * (1 - median(alone) / median(seconds)); };
  fmt::print("{:<40} {:>9.1f} s ({:.1f} to {:.1f})\n", "nobody looks", median(alone), least, most);
  fmt::print("{:<40} {:>9.1f} % slower\n", "a page that rests", slower(resting));
  fmt::print("{:<40} {:>9.1f} % slower\n", "a page that turns", slower(turning));
}

}  // namespace
}  // namespace cnerf::studio

int main(int argc, char** argv) {
  try {
    std::filesystem::path capture, folder;
    cnerf::Config config;
    cnerf::studio::Part part{4e6, 24e6};
    for (int i = 1; i < argc; ++i) {
      const std::string word = argv[i];
      const auto equals = word.find('=');
      const std::string value = equals == std::string::npos ? "" : word.substr(equals + 1);
      if (word.starts_with("from="))
        part.begin = std::stod(value);
      else if (word.starts_with("to="))
        part.end = std::stod(value);
      else if (word.starts_with("device="))
        config.device = value;
      else if (word.starts_with("downscale="))
        config.capture.downscale = std::stoi(value);
      else
        (capture.empty() ? capture : folder) = word;
    }
    if (folder.empty()) throw cnerf::UsageError("CAPTURE FOLDER [from=4e6] [to=24e6] [device=auto] [downscale=N]");
    config.stage1.steps = 10000000;
    cnerf::studio::measure(capture, folder, config, part);
    return 0;
  } catch (const std::exception& problem) {
    fmt::print(stderr, "cnerf-studio-training: {}\n", problem.what());
    return 1;
  }
}
