// What a training in the studio loses to a page that looks at it.
//   cnerf-studio-training CAPTURE FOLDER [from=4e6] [each=24e6] [rounds=6] [device=auto] [downscale=N]
//     FOLDER    for the run; made anew
//     each      samples: how long so many take with nobody there, with a page that rests, and with one that turns the
//               camera, in turns within one training. Longer than a page rests between two frames.
//     rounds    a multiple of three, so that each of the three is first, second and third as often

#include <fmt/format.h>

#include <array>
#include <atomic>
#include <chrono>
#include <numeric>
#include <thread>

#include "src/base/error.h"
#include "src/base/usage.h"
#include "src/pipeline/run_context.h"
#include "src/studio/studio.h"

namespace cnerf::studio {
namespace {
namespace fs = std::filesystem;

enum class Page { kNobody, kRests, kTurns };
constexpr std::array kPages = {Page::kNobody, Page::kRests, Page::kTurns};
constexpr std::array kNames = {"nobody looks", "a page that rests", "a page that turns"};

std::string asked_frame(const Capture& capture, double share, bool is_moving) {
  const SceneMessage scene = scene_of(capture, "");
  const ViewMessage& view = scene.views[std::size_t(scene.home)];
  FrameMessage frame{view.camera, {"grey"}, is_moving};
  const int width = int(1280 * share), height = int(720 * share);
  const double f = view.camera.lens.fy * height / view.camera.lens.height;
  frame.camera.lens = {width, height, f, f, width / 2.0, height / 2.0};
  return json_of(frame).dump();
}

struct Looking {
  std::atomic<Page> page = Page::kNobody;
  std::atomic<bool> waits_for_frame = false, is_over = false;
};

/// A page as viewer/src/studio/scheduler.ts has it: coarse frames one after another while it turns; at rest a coarse
/// one and one of twice its size whenever the colours changed.
void look(Studio& studio, const Capture& capture, Looking& looking) {
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
  while (!looking.is_over) {
    looking.waits_for_frame = true;
    if (looking.page == Page::kTurns) {
      ask(coarse, true);
      continue;
    }
    looking.waits_for_frame = false;
    const auto news = studio.wait_for_news(seen, 0.2);
    if (!news) continue;
    seen = news->first;
    const auto now = parse_json(news->second, "state").value("colors", std::uint64_t(0));
    if (std::exchange(colors, now) == now || looking.page == Page::kNobody) continue;
    looking.waits_for_frame = true;
    ask(coarse, false);
    ask(std::min(2 * coarse, 0.5), false);
  }
}

/// The parts of a training that are timed, in samples. What is half learned is slower, so that they take turns.
struct Parts {
  double begin = 0, each = 0;
  int rounds = 0;
};

/// Seconds that `Parts::each` took in each round, with each of `kPages`.
using Times = std::array<std::vector<double>, kPages.size()>;

Times timed(Studio& studio, const Capture& capture, const Parts& parts) {
  const auto samples = [&] {
    const auto state = parse_json(studio.answer({"GET", "/studio/state", {}, "bench", {}, {}}).body, "state");
    return state.at("figures").value("samples", 0.0);
  };
  const auto wait_for = [&](double count) {
    while (samples() < count) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  };
  Looking looking;
  wait_for(1);
  std::thread client([&] { look(studio, capture, looking); });
  wait_for(parts.begin);
  Times times;
  for (int round = 0; round < parts.rounds; ++round) {
    for (std::size_t i = 0; i < kPages.size(); ++i) {
      const std::size_t p = (i + std::size_t(round)) % kPages.size();
      looking.page = kPages[p];
      // From one change of the figures to another: they change ten times a second.
      const double before = samples();
      wait_for(before + 1);
      const double begin = samples();
      const Stopwatch watch;
      wait_for(begin + parts.each);
      times[p].push_back(watch.seconds() * parts.each / (samples() - begin));
      looking.page = Page::kNobody;
      while (looking.waits_for_frame) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }
  looking.is_over = true;
  client.join();
  return times;
}

void report(const Times& times) {
  const auto mean = [](const std::vector<double>& seconds) {
    return std::accumulate(seconds.begin(), seconds.end(), 0.0) / double(seconds.size());
  };
  const double alone = mean(times[0]);
  for (std::size_t p = 0; p < kPages.size(); ++p) {
    const auto [least, most] = std::ranges::minmax(times[p]);
    fmt::print("{:<24} {:>6.1f} s ({:.1f} to {:.1f})", kNames[p], mean(times[p]), least, most);
    if (p > 0) fmt::print(", {:.1f} % slower", 100 * (1 - alone / mean(times[p])));  // of its speed
    fmt::print("\n");
  }
}

void measure(const fs::path& capture, const fs::path& folder, const Config& config, const Parts& parts) {
  const Engines& engines = engines_for(config.device);
  Observer observer;
  pipeline::RunContext context{pipeline::RunDirectory(folder),
                               config,
                               pipeline::read_capture(capture, config, observer),
                               {"cnerf-studio-training"}};
  pipeline::begin_run(context, capture, {.overwrite = true});
  Studio studio(context, "", engines, observer);
  std::thread worker([&] { studio.run(); });
  const Times times = timed(studio, context.capture, parts);
  studio.close();
  worker.join();
  report(times);
}

}  // namespace
}  // namespace cnerf::studio

int main(int argc, char** argv) {
  try {
    std::filesystem::path capture, folder;
    cnerf::Config config;
    cnerf::studio::Parts parts{4e6, 24e6, 6};
    for (int i = 1; i < argc; ++i) {
      const std::string word = argv[i];
      const auto equals = word.find('=');
      const std::string value = equals == std::string::npos ? "" : word.substr(equals + 1);
      if (word.starts_with("from="))
        parts.begin = std::stod(value);
      else if (word.starts_with("each="))
        parts.each = std::stod(value);
      else if (word.starts_with("rounds="))
        parts.rounds = std::stoi(value);
      else if (word.starts_with("device="))
        config.device = value;
      else if (word.starts_with("downscale="))
        config.capture.downscale = std::stoi(value);
      else
        (capture.empty() ? capture : folder) = word;
    }
    if (folder.empty())
      throw cnerf::UsageError("CAPTURE FOLDER [from=4e6] [each=24e6] [rounds=6] [device=auto] [downscale=N]");
    config.stage1.steps = 10000000;
    cnerf::studio::measure(capture, folder, config, parts);
    return 0;
  } catch (const std::exception& problem) {
    fmt::print(stderr, "cnerf-studio-training: {}\n", problem.what());
    return 1;
  }
}
