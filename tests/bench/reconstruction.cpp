// Quality over time of stage 1 on a real capture: trains with the given options and prints the held-out luminance PSNR
// (docs/decisions/linear-luminance.md) at growing training times. Evaluation does not count as training time. With
// `samples` the marks are millions of trained samples instead, which do not depend on what else the machine does.
//
//   reconstruction CAPTURE [downscale=1] [holdout=8] [seconds=60] [option=value ...]
//   reconstruction CAPTURE [downscale=1] [holdout=8] samples=70,140,340 [pictures=FOLDER] [option=value ...]
//
// `gain`, `degrees`, `shift` and `focal` make the capture worse first (Disturbance); `aligned=1` fits the poses of
// held-out views; `adjust=1` adjusts cameras to features first, `adjust=2` lenses too. With `points=1` sparse points
// are triangulated first. With `validation=N` every N-th of the views to be trained on is judged instead of the
// held-out ones; `few=N` trains on every N-th view alone. Options are stage 1's by their short names, e.g.
// grid.log2_rows=16 steps_per_box=512 samples_per_step=65536.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "src/capture/load_capture.h"
#include "src/prepare/bundle_adjustment.h"
#include "src/prepare/sparse_points.h"
#include "src/train/luminance/depth_hints.h"
#include "src/train/luminance/luminance_model.h"
#include "src/train/luminance/options_json.h"
#include "tests/support/disturbed_capture.h"
#include "tests/support/held_out_views.h"
#include "tests/support/occupied_share.h"
#include "tests/support/validation_fold.h"

namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// Sets the option a dotted path names, in the options' JSON form.
void set_option(nlohmann::json& options, const std::string& path, const std::string& value) {
  const std::string pointer = "/" + [&] {
    std::string text = path;
    std::replace(text.begin(), text.end(), '.', '/');
    return text;
  }();
  nlohmann::json& target = options.at(nlohmann::json::json_pointer(pointer));
  if (target.is_string()) {
    target = value;
  } else {
    target = nlohmann::json::parse(value);
  }
}

/// Processor seconds of all threads: on a busy machine a fairer clock than the wall's.
double processor_seconds() {
  return double(std::clock()) / CLOCKS_PER_SEC;
}

double held_out_psnr(const cnerf::Capture& capture, const cnerf::LuminanceModel& model, int every,
                     const cnerf::RenderEffort& effort, std::vector<float>* transmittance = nullptr) {
  double total = 0;
  int views = 0, index = 0;
  for (const cnerf::View& view : capture.views) {
    if (!view.held_out || index++ % every != 0) continue;
    const cnerf::UnitCamera camera(view.intrinsics, view.world_from_camera, model.frame);
    std::vector<cnerf::Ray> rays;
    for (int y = 0; y < view.image.height; ++y) {
      for (int x = 0; x < view.image.width; ++x) rays.push_back(camera.ray({x + 0.5, y + 0.5}));
    }
    std::vector<cnerf::RayResult> results(rays.size());
    model.engine->render(rays, model.march(), effort, results);
    if (transmittance != nullptr) {
      for (const cnerf::RayResult& result : results) transmittance->push_back(1 - result.opacity);
    }
    total += cnerf::test::psnr_of(results, view.image);
    ++views;
  }
  return views > 0 ? total / views : 0;
}

/// Triangulates sparse points, in place of those of the file.
void print_points(cnerf::Capture& capture) {
  const Clock::time_point start = Clock::now();
  cnerf::Observer silent;
  capture.points = cnerf::prepare::find_sparse_points(capture, silent);
  std::size_t of_three = 0, sightings = 0;
  double error = 0;
  for (const cnerf::SparsePoint& point : capture.points) {
    of_three += point.views.size() >= 3 ? 1 : 0;
    sightings += point.views.size();
    error += point.error;
  }
  const auto all = double(std::max<std::size_t>(1, capture.points.size()));
  std::printf("%zu points, %zu of three views or more, %.2f views each, %.3f pixels off, in %.1f s\n",
              capture.points.size(), of_three, double(sightings) / all, error / all, seconds_since(start));
}

/// Adjusts its cameras, with lenses if asked; its points become those that the adjusted cameras show.
void print_adjustment(cnerf::Capture& capture, bool lenses) {
  const Clock::time_point start = Clock::now();
  cnerf::Stage1Options asked;
  asked.poses = true;
  asked.lenses = lenses;
  cnerf::Observer silent;
  cnerf::prepare::AdjustedCameras cameras = cnerf::prepare::adjust_cameras(capture, asked, silent);
  capture.points = std::move(cameras.points);
  std::printf("cameras %s: evidence %.1f; %zu points, %.3f pixels off, %.3f before, in %.1f s\n",
              cameras.moved.corrections.empty() ? "left alone" : "adjusted", cameras.evidence, capture.points.size(),
              cameras.error_after, cameras.error_before, seconds_since(start));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::puts("reconstruction CAPTURE [downscale=N] [holdout=N] [seconds=S | samples=M,...] [option=value ...]");
    return 64;
  }
  std::map<std::string, double> own = {{"downscale", 1}, {"holdout", 8}, {"seconds", 60}, {"eval_every", 1},
                                       {"verbose", 0},   {"points", 0},  {"first", 0.25}, {"validation", 0},
                                       {"gain", 0},      {"degrees", 0}, {"shift", 0},    {"aligned", 0},
                                       {"focal", 0},     {"few", 0},     {"adjust", 0},   {"repoint", 0}};
  std::string pictures;       // a folder for what is seen of the held-out views
  std::vector<double> marks;  // of the training's length: million samples if given, else seconds
  nlohmann::json json = cnerf::options_to_json(cnerf::Stage1Options{});
  for (int i = 2; i < argc; ++i) {
    const std::string argument = argv[i];
    const std::size_t equals = argument.find('=');
    const std::string key = argument.substr(0, equals), value = argument.substr(equals + 1);
    if (key == "samples") {
      std::stringstream list(value);
      for (std::string mark; std::getline(list, mark, ',');) marks.push_back(std::stod(mark));
    } else if (key == "pictures") {
      pictures = value;
    } else if (own.count(key) > 0) {
      own[key] = std::stod(value);
    } else {
      set_option(json, key, value);
    }
  }
  const bool by_samples = !marks.empty();
  if (!by_samples) {
    for (double mark = own["seconds"] * own["first"]; mark < own["seconds"]; mark *= 2) marks.push_back(mark);
    marks.push_back(own["seconds"]);
  }
  const auto options = cnerf::options_from_json<cnerf::Stage1Options>(json);
  cnerf::CaptureOptions capture_options;
  capture_options.downscale = int(own["downscale"]);
  capture_options.holdout = int(own["holdout"]);
  cnerf::Capture capture = cnerf::load_capture(argv[1], capture_options);
  if (own["validation"] > 0) cnerf::test::hold_out_of_training(capture, int(own["validation"]));
  if (own["few"] > 0) cnerf::test::train_on_few(capture, int(own["few"]));
  if (own["points"] > 0) print_points(capture);
  const std::vector<cnerf::Affined> truth = cnerf::test::training_poses(capture);
  cnerf::test::disturb(capture, {own["gain"], own["degrees"], own["shift"], own["focal"]});
  if (own["adjust"] > 0) print_adjustment(capture, own["adjust"] > 1);
  cnerf::LuminanceModel model = cnerf::LuminanceModel::create(capture, options, cnerf::cpu_engines());
  auto views = cnerf::training_views(capture, model.frame);
  const std::vector<cnerf::DepthHints> depths = cnerf::depth_hints(capture, model.frame, capture.points);
  cnerf::show_to(views, depths);
  model.engine->set_views(views);
  std::printf("%zu training views of %dx%d, %d cascades, side %.3f world units\n", views.size(), views[0].image->width,
              views[0].image->height, model.frame.cascades, 1 / model.frame.unit_per_world);

  const cnerf::RenderEffort all = {1e-4f, 1.0f}, quick = {1e-3f, 0.995f};  // what is left out is measured at the end
  double trained = 0, rays = 0, elapsed = 0, processor = 0;
  const cnerf::OccupancyLayout layout(options.occupancy.resolution, model.frame.cascades);
  const auto length = [&] { return by_samples ? trained / 1e6 : elapsed; };
  for (std::size_t reached = 0; reached < marks.size();) {
    const Clock::time_point start = Clock::now();
    const double processor_start = processor_seconds();
    const double fraction = length() / marks.back();
    const double decay = std::clamp(2.0 * fraction - 1.0, 0.0, 1.0);
    const auto rate =
        float(options.learning_rate * std::pow(options.final_learning_rate / options.learning_rate, decay));
    const cnerf::StepReport step = model.engine->step(rate);
    elapsed += seconds_since(start);
    processor += processor_seconds() - processor_start;
    trained += double(step.trained_samples);
    rays += double(step.rays);
    if (own["verbose"] > 0 && model.engine->step_count() % int(own["verbose"]) == 0) {
      std::printf("step %ld  %.2f s  rays %zu  trained %zu  loss %.5f  occupied %.4f\n", model.engine->step_count(),
                  elapsed, step.rays, step.trained_samples, step.loss,
                  cnerf::test::occupied_share(model.engine->occupancy(), layout));
    }
    if (length() < marks[reached]) continue;
    ++reached;
    const Clock::time_point eval_start = Clock::now();
    const double psnr = held_out_psnr(capture, model, int(own["eval_every"]), quick);
    std::printf(
        "%7.1f s  %5ld steps  %7.1f M samples  %5.1f per ray  %.3f us/sample (%.3f of processor)  occupied "
        "%.4f  "
        "PSNR %.2f dB  (eval %.1f s)\n",
        elapsed, model.engine->step_count(), trained / 1e6, trained / rays, 1e6 * elapsed / trained,
        1e6 * processor / trained, cnerf::test::occupied_share(model.engine->occupancy(), layout), psnr,
        seconds_since(eval_start));
    std::fflush(stdout);
  }
  for (const auto& [name, effort] : {std::pair("every sample shaded", all), std::pair("as pictures are", quick)}) {
    const Clock::time_point start = Clock::now();
    std::vector<float> transmittance;
    const double psnr = held_out_psnr(capture, model, int(own["eval_every"]), effort, &transmittance);
    const auto middle = transmittance.begin() + std::ptrdiff_t(transmittance.size() / 2);
    std::nth_element(transmittance.begin(), middle, transmittance.end());
    const auto held_out =
        std::count_if(capture.views.begin(), capture.views.end(), [](const auto& v) { return v.held_out; });
    std::printf("rendered, %s: %.3f dB, %.2f s a view, median transmittance %.5f\n", name, psnr,
                seconds_since(start) / double(held_out), *middle);
  }
  cnerf::test::Judge judge{capture, model.frame, *model.engine, model.march(), quick, pictures};
  if (own["aligned"] > 0) {
    judge.alignment = cnerf::test::print_alignment(judge, truth);
  }
  cnerf::test::print_held_out(judge.judge());
  return 0;
}
