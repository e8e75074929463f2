#include "src/compare/run.h"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/json_record.h"
#include "src/base/text.h"
#include "src/capture/color_truth.h"
#include "src/compare/baselines/flow.h"
#include "src/compare/baselines/positional_field.h"
#include "src/compare/baselines/simulated.h"
#include "src/compare/baselines/style_transfer.h"
#include "src/compare/page.h"
#include "src/compare/rating.h"
#include "src/compare/stage2_variants.h"
#include "src/picture/contact_sheet.h"
#include "src/picture/encode.h"
#include "src/pipeline/colorize_step.h"
#include "src/pipeline/picture_files.h"
#include "src/pipeline/render_step.h"
#include "src/render/camera_path.h"
#include "src/train/chroma/color_model.h"
#include "src/train/luminance/luminance_model.h"
#include "src/train/luminance/options_json.h"
#include "src/train/luminance/placement.h"

namespace cnerf::compare {
using namespace pipeline;
namespace fs = std::filesystem;
namespace {

constexpr int kUsualHoldout = 8;       // where neither the capture nor the user says
constexpr int kShownViews = 4;         // of a capture, in the report
constexpr int kPictureWidth = 480;     // pixels, in the report
constexpr int kPictureQuality = 88;    // of JPEG
constexpr int kFrameQuality = 80;      // of a turntable's
constexpr int kFramesPerSecond = 12;   // of a turntable
constexpr std::size_t kLongRange = 8;  // the turntable's share that long-range consistency looks across

constexpr int kStripWidth = 168;  // pixels of a picture in a strip: a document shows four side by side
constexpr int kStripColumns = 4;
constexpr std::size_t kMeasuredPixels = 1024;  // of a learning curve: rendering them by an MLP takes seconds
constexpr int kManySteps = 100'000'000;        // the time ends a training, not these

bool is_simulated(const std::string& spec) {
  return spec == "simulated" || spec.starts_with("simulated:");
}

/// @throws UsageError
SimulationOptions simulation_of(const std::string& spec) {
  const std::size_t colon = spec.find(':');
  return parse_simulation(colon == std::string::npos ? "" : spec.substr(colon + 1));
}

std::string read_picture(const fs::path& file, const char* type) {
  return data_uri(type, read_binary_file(file));
}

std::vector<std::string> read_pictures(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code failure;
  for (const auto& entry : fs::directory_iterator(folder, failure)) files.push_back(entry.path());
  std::ranges::sort(files);
  std::vector<std::string> pictures;
  for (const fs::path& file : files) pictures.push_back(read_picture(file, "jpeg"));
  return pictures;
}

void write_jpeg(const fs::path& file, const Picture& picture, int width, int quality) {
  write_file(file, std::span<const std::byte>(jpeg_bytes(scaled_down(picture, width), quality)));
}

std::string digest(const std::string& text) {
  return sha256(std::as_bytes(std::span(text)));
}

std::string numbered(std::size_t index) {
  return fmt::format("{:04}.jpg", index);
}

/// Evenly spread indices.
std::vector<std::size_t> some_of(std::size_t all, std::size_t wanted) {
  std::vector<std::size_t> indices;
  const std::size_t count = std::min(all, wanted);
  for (std::size_t i = 0; i < count; ++i) indices.push_back(i * all / count);
  return indices;
}

bool any_held_out(const Capture& capture) {
  return std::ranges::any_of(capture.views, [](const View& view) { return view.held_out; });
}

/// The settings that a folder was made with; empty when it was not.
std::string settings_in(const fs::path& folder) {
  const fs::path file = folder / "settings.txt";
  return fs::exists(file) ? read_text_file(file) : "";
}

std::string to_text(const std::vector<LearningPoint>& curve) {
  std::string text;
  for (const LearningPoint& point : curve) text += fmt::format("{:.6g} {:.6g}\n", point.seconds, point.value);
  return text;
}
std::vector<LearningPoint> read_curve(const fs::path& file) {
  std::vector<LearningPoint> curve;
  std::istringstream lines(fs::exists(file) ? read_text_file(file) : "");
  for (LearningPoint point; lines >> point.seconds >> point.value;) curve.push_back(point);
  return curve;
}

/// Trains stage 1, and leaves the curve of its PSNR beside the snapshot.
Stage1Report train_measured(const Capture& capture, std::span<const View* const> views, const Stage1Options& options,
                            const fs::path& snapshot, const Engines& engines, Observer& observer) {
  const SceneFrame frame = place_scene(capture, options.placement);
  const HeldOutPixels pixels(views, frame, kMeasuredPixels);
  const MarchSettings march = march_settings(frame.cascades, options.steps_per_box, options.cone_angle);
  const WatchedEngines watched(engines);
  LearningCurve curve("stage 1", observer, [&] { return pixels.psnr(watched.luminance(), march); });
  const Stage1Report report = train_stage1({capture, options, snapshot, true}, watched, curve);
  // The engine is gone; what it came to is in the snapshot. What an earlier part of the training took comes first.
  const double before = curve.points().empty() ? report.seconds : report.seconds - curve.seconds();
  std::vector<LearningPoint> points = curve.points();
  for (LearningPoint& point : points) point.seconds += std::max(before, 0.0);
  points.push_back({report.seconds, pixels.psnr(*LuminanceModel::load(snapshot, engines).engine, march)});
  write_file(fs::path(snapshot).replace_extension(".curve"), to_text(points));
  return report;
}

/// A small tile of a picture in linear light.
Tile tile_of(int width, int height, const std::vector<float>& linear, std::string caption) {
  return {scaled_down(picture_from_linear(width, height, linear), kStripWidth), std::move(caption)};
}

/// An empty folder unless it was made with these settings.
void begin_folder(const fs::path& folder, const std::string& settings) {
  if (settings_in(folder) == settings) return;
  fs::remove_all(folder);
  write_file(folder / "settings.txt", settings);
}

}  // namespace

ComparedCapture parse_compared_capture(const std::string& text) {
  const std::size_t at = text.rfind('@');
  const std::string digits = at == std::string::npos ? "" : text.substr(at + 1);
  const bool is_number =
      !digits.empty() && digits.size() < 3 && digits.find_first_not_of("0123456789") == std::string::npos;
  if (at == std::string::npos || fs::exists(text)) return {text, 0};
  if (!is_number || std::stoi(digits) < 1 || std::stoi(digits) > 64) {
    throw UsageError("CAPTURE: " + text + ": expected FOLDER@N, image sizes divided by N from 1 to 64");
  }
  return {text.substr(0, at), std::stoi(digits)};
}

struct Run::Subject {
  std::string name;
  CaptureOptions options;
  Capture capture;
  std::vector<const View*> evaluated;

  [[nodiscard]] std::vector<std::size_t> shown() const { return some_of(evaluated.size(), kShownViews); }
};

struct Run::Geometry {
  fs::path folder;
  ViewCache training_views;
};

/// What a method's colours stand on.
struct Run::Field {
  fs::path stage1;                         ///< snapshot
  std::shared_ptr<const Engines> own;      ///< of a stage 1 of its own, and of colours on it
  std::shared_ptr<const Engines> engines;  ///< of `stage1` and of the colours
};

Run::Field Run::field_of(const Subject& subject, const Method& method, const Geometry& geometry) const {
  Field field;
  field.stage1 = geometry.folder / "stage1.snapshot";
  field.engines = {std::shared_ptr<void>(), &engines_};  // not owned
  if (!method.has_own_field) return field;
  const PositionalRays rays =
      positional_rays(subject.capture, place_scene(subject.capture, config_.run.stage1.placement));
  field.own = positional_engines(rays);
  field.engines = positional_engines(rays, false, &engines_);
  return field;
}

Run::Run(Plan plan, CompareConfig config, Observer& observer)
    : plan_(std::move(plan)),
      config_(std::move(config)),
      observer_(observer),
      engines_(engines_for(config_.run.device)) {
  if (!plan_.lpips_weights.empty()) lpips_ = std::make_unique<Lpips>(plan_.lpips_weights);
  if (is_simulated(config_.run.colorizer.spec)) (void)simulation_of(config_.run.colorizer.spec);
  for (const auto& [path, downscale] : plan_.captures) {
    auto subject = std::make_shared<Subject>();
    Config of_subject = config_.run;
    if (downscale > 0) of_subject.capture.downscale = downscale;
    subject->capture = read_capture(path, of_subject, observer_);
    if (!any_held_out(subject->capture) && config_.run.capture.holdout == 0) {
      of_subject.capture.holdout = kUsualHoldout;
      observer_.say(fmt::format("nothing is held out by the capture: every {}th view is", kUsualHoldout));
      subject->capture = load_capture(path, of_subject.capture);
    }
    subject->options = of_subject.capture;
    subject->evaluated = views_to_evaluate(subject->capture, {});
    if (!load_color_truth(*subject->evaluated.front())) {
      throw InputError(subject->evaluated.front()->image_file, "colour",
                       "methods are compared with true colours, and this picture is grey");
    }
    const std::string name = fs::absolute(path / "").lexically_normal().parent_path().filename().string();
    subject->name = name;
    for (int copy = 2; std::ranges::any_of(subjects_, [&](const auto& other) { return other->name == subject->name; });
         ++copy) {
      subject->name = fmt::format("{}-{}", name, copy);
    }
    subjects_.push_back(std::move(subject));
  }
}

void Run::run() {
  for (const auto& subject : subjects_) {
    for (const int seed : plan_.seeds) plan_.only_report ? collect(*subject, seed) : run_capture(*subject, seed);
  }
  if (cells_.empty()) throw UsageError(plan_.report.string() + ": no finished method of these captures and seeds");
}

fs::path Run::folder_of(const Subject& subject, int seed) const {
  return plan_.report / "runs" / subject.name / fmt::format("seed-{}", seed);
}

void Run::run_capture(const Subject& subject, int seed) {
  Geometry geometry{folder_of(subject, seed), {}};
  const std::string stage1_settings = train(subject, seed, geometry.folder);
  for (const Method* method : plan_.methods) {
    const std::string settings =
        digest(stage1_settings + method->name + options_to_json(stage2_of(*method, config_.run.stage2)).dump() +
               (method->has_own_field || method->matches_features ? options_to_json(config_.own).dump() : "") +
               options_to_json(config_.run.colorizer).dump() + options_to_json(config_.run.render).dump() +
               (lpips_ ? lpips_->network() : ""));
    cells_.push_back(run_cell(subject, *method, seed, geometry, settings));
  }
}

void Run::collect(const Subject& subject, int seed) {
  for (const Method* method : plan_.methods) {
    const fs::path file = folder_of(subject, seed) / method->name / "cell.json";
    if (fs::exists(file)) cells_.push_back(read_record<Cell>(file));
  }
}

std::string Run::train(const Subject& subject, int seed, const fs::path& folder) const {
  Stage1Options options = config_.run.stage1;
  options.seed = seed;
  const std::string settings = digest(fs::absolute(subject.capture.root).string() + options_to_json(options).dump() +
                                      options_to_json(subject.options).dump());
  const fs::path done = folder / "stage1.txt";
  if (settings_in(folder) == settings && fs::exists(done)) return settings;
  begin_folder(folder, settings);
  observer_.say(fmt::format("{}, seed {}: stage 1", subject.name, seed));
  const Stage1Report report =
      train_measured(subject.capture, subject.evaluated, options, folder / "stage1.snapshot", engines_, observer_);
  write_file(done, fmt::format("{} steps, {:.1f} s, {:.2f} dB on training pixels\n", report.steps, report.seconds,
                               report.train_psnr));
  return settings;
}

Cell Run::run_cell(const Subject& subject, const Method& method, int seed, Geometry& geometry,
                   const std::string& settings) const {
  const fs::path folder = geometry.folder / method.name;
  const fs::path file = folder / "cell.json";
  if (fs::exists(file) && settings_in(folder) == settings) {
    Cell finished = read_record<Cell>(file);
    if (finished.error.empty()) return finished;
  }
  begin_folder(folder, settings);
  observer_.say(fmt::format("{}, seed {}: {}", subject.name, seed, method.name));
  Cell cell;
  cell.capture = subject.name;
  cell.method = method.name;
  cell.seed = seed;
  cell.settings = settings;
  try {
    if (method.is_colored) colorize(subject, method, seed, geometry, cell);
    look(subject, method, geometry, cell);
  } catch (const Interrupted&) {
    throw;
  } catch (const std::exception& problem) {
    cell.error = problem.what();
    observer_.say(fmt::format("{} failed: {}", method.name, problem.what()));
  }
  write_file(file, to_json(cell).dump(2) + "\n");
  return cell;
}

std::unique_ptr<Colorizer> Run::colorizer_for(const Subject& subject, const Method& method, int seed) const {
  const std::string& spec = config_.run.colorizer.spec;
  if (method.knows_truth) return make_simulated_colorizer(subject.capture, oracle_simulation());
  std::unique_ptr<Colorizer> colorizer;
  if (is_simulated(spec)) {
    SimulationOptions options = simulation_of(spec);
    options.seed += seed - 1;  // each seed meets other errors
    colorizer = make_simulated_colorizer(subject.capture, options);
  } else {
    Config of_seed = config_.run;
    of_seed.stage2.seed = seed;
    colorizer = make_colorizer(of_seed.colorizer, colorizer_context(of_seed, subject.capture.root,
                                                                    folder_of(subject, seed) / "cache", observer_));
  }
  if (!method.follows_flow) return colorizer;
  return std::make_unique<FlowColorizer>(std::move(colorizer));
}

/// Stage 1 of a method that has a field of its own: some times as long as the shared one took.
void Run::train_own_field(const Subject& subject, int seed, const Geometry& geometry, const Engines& engines,
                          Cell& cell) const {
  Stage1Options options = config_.run.stage1;
  options.seed = seed;
  options.steps = kManySteps;
  options.checkpoint_every = 0;
  options.max_seconds =
      config_.own.positional_budget * LuminanceModel::load(geometry.folder / "stage1.snapshot", engines_).seconds;
  options.learning_rate = kPositionalLearningRate;
  options.final_learning_rate = kPositionalFinalLearningRate;
  const fs::path snapshot = geometry.folder / cell.method / "stage1.snapshot";
  (void)train_measured(subject.capture, subject.evaluated, options, snapshot, engines, observer_);
  cell.stage1_curve = read_curve(fs::path(snapshot).replace_extension(".curve"));
}

/// ARF in place of stage 2.
StyleReport Run::transfer(const Subject& subject, const fs::path& stage1, const Stage2Options& options,
                          Colorizer& colorizer, const fs::path& take) const {
  const CompareOptions& compare = config_.own;
  const fs::path network = compare.style_network.empty() ? plan_.lpips_weights : fs::path(compare.style_network);
  if (network.empty()) {
    throw UsageError(
        "style-transfer: needs a network of features: --lpips-weights of AlexNet, or compare.style_network");
  }
  const LabPicture reference = compare.style_reference.empty()
                                   ? colorized_view(subject.capture, stage1, colorizer, engines_)
                                   : reference_image(compare.style_reference);
  const StyleLoss loss(network, reference);
  return transfer_style(subject.capture, stage1, loss, reference, options, compare.style_steps, take, engines_,
                        observer_);
}

void Run::colorize(const Subject& subject, const Method& method, int seed, Geometry& geometry, Cell& cell) const {
  Stage2Options options = stage2_of(method, config_.run.stage2);
  options.seed = seed;
  Field field = field_of(subject, method, geometry);
  if (method.has_own_field) train_own_field(subject, seed, geometry, *field.own, cell);
  const auto colorizer = colorizer_for(subject, method, seed);
  const fs::path take = geometry.folder / method.name / "take.snapshot";
  if (method.matches_features) {
    const StyleReport report = transfer(subject, field.stage1, options, *colorizer, take);
    cell.seconds = report.seconds;
    cell.metrics.colorizer = colorizer->name();
    return;
  }

  const bool is_measured = method.has_own_field || std::string(method.name) == kMethods[0].name;
  std::optional<HeldOutPixels> pixels;
  const WatchedEngines engines(*field.engines);
  LearningCurve curve("stage 2", observer_,
                      [&] { return pixels->ab_error(engines.color_bins(), float(options.decode_temperature)); });
  if (is_measured && !is_photometric(method)) {
    const LuminanceModel model = LuminanceModel::load(field.stage1, *field.engines);
    pixels.emplace(subject.evaluated, model.frame, kMeasuredPixels);
    pixels->trace(*model.engine, model.march());
  }
  if (pixels) fs::remove(take);  // a curve is of one training from its beginning
  const Photometric photometric;
  ViewQuestions whole_views;
  Observer& observer = pixels ? static_cast<Observer&>(curve) : observer_;
  const Stage2Report report = train_stage2({subject.capture,
                                            field.stage1,
                                            options,
                                            *colorizer,
                                            {},
                                            take,
                                            true,
                                            &geometry.training_views,
                                            asks_about_views(method) ? &whole_views : nullptr,
                                            is_photometric(method) ? &photometric : nullptr},
                                           engines, observer);
  if (pixels && !curve.points().empty()) {
    cell.stage2_curve = curve.points();
    const ColorModel model = ColorModel::load(take, *field.engines);
    cell.stage2_curve.push_back({curve.seconds(), pixels->ab_error(*model.chroma, float(options.decode_temperature))});
  }
  if (std::string(method.name) == kMethods[0].name) {
    cell.stage1_curve = read_curve(geometry.folder / "stage1.curve");
  }
  cell.accepted = report.accepted;
  cell.rejected = report.rejected;
  cell.seconds = report.seconds;
  cell.metrics.colorizer = colorizer->name();
}

/// Measures the views, and renders what is shown of a method.
void Run::look(const Subject& subject, const Method& method, Geometry& geometry, Cell& cell) const {
  const fs::path folder = geometry.folder / method.name;
  const Field field = field_of(subject, method, geometry);
  const auto scene =
      Scene::load(field.stage1, method.is_colored ? folder / "take.snapshot" : fs::path(), *field.engines);
  EvaluateOptions options;
  options.render = render_options(config_.run);
  options.lpips = lpips_.get();
  options.with_baked = false;
  options.grey_as_color = true;
  const std::vector<std::size_t> shown = subject.shown();
  std::size_t index = 0;
  const auto keep_shown = [&](const EvaluatedView& view) {
    const auto place = std::ranges::find(shown, index++);
    if (place == shown.end()) return;
    write_jpeg(folder / "views" / numbered(std::size_t(place - shown.begin())),
               picture_of(view.ours, ShownColor::kDecoded), kPictureWidth, kPictureQuality);
  };
  const std::string colorizer = cell.metrics.colorizer;
  cell.metrics = evaluate(*scene, subject.capture, options, keep_shown, observer_.progress_sink());
  cell.metrics.take = method.name;
  cell.metrics.colorizer = colorizer;

  const CameraPath path = turntable_path(subject.capture, config_.run.render);
  std::vector<RenderedImage> frames;
  std::vector<SeenView> seen;
  frames.reserve(path.cameras.size());
  for (const PathCamera& camera : path.cameras) {
    if (observer_.is_cancelled()) throw Interrupted("comparison stopped");
    frames.push_back(scene->render(camera.intrinsics, camera.world_from_camera, options.render));
    write_jpeg(folder / "turntable" / numbered(frames.size() - 1), picture_of(frames.back(), ShownColor::kDecoded),
               kPictureWidth, kFrameQuality);
    seen.push_back({&frames.back(), camera.intrinsics, camera.world_from_camera});
    observer_.progress_sink()({"turntable", double(frames.size()) / double(path.cameras.size()), {}});
  }
  if (!method.is_colored) return;
  cell.short_range = consistency(seen, 1);
  cell.long_range = consistency(seen, std::max<std::size_t>(2, path.cameras.size() / kLongRange));
}

Summary Run::summary() const {
  const std::string& spec = config_.run.colorizer.spec;
  const std::string colorizer = is_simulated(spec) ? "simulated:" + to_text(simulation_of(spec)) : spec;
  return {colorizer, lpips_ ? lpips_->network() : "", plan_.command_line};
}

/// Pictures of the first seed.
ReportCapture Run::report_of(const Subject& subject) const {
  ReportCapture report;
  report.name = subject.name;
  report.frames_per_second = kFramesPerSecond;
  for (const std::size_t index : subject.shown()) {
    const View& view = *subject.evaluated[index];
    report.views.push_back(view.name);
    report.inputs.push_back(
        data_uri("jpeg", jpeg_bytes(scaled_down(grey_picture(view.image), kPictureWidth), kPictureQuality)));
    const std::optional<ColorImage> truth = load_color_truth(view);
    if (!truth) continue;
    const Picture picture = picture_from_linear(truth->width, truth->height, truth->rgb);
    report.truths.push_back(data_uri("jpeg", jpeg_bytes(scaled_down(picture, kPictureWidth), kPictureQuality)));
  }
  if (report.truths.size() != report.inputs.size()) report.truths.clear();
  const fs::path runs = folder_of(subject, plan_.seeds.front());
  for (const Method* method : plan_.methods) {
    const fs::path folder = runs / method->name;
    ReportMethod shown{method->name, read_pictures(folder / "views"), read_pictures(folder / "turntable"), {}};
    for (const auto& [file, title] : {std::pair{"bases.png", "base images"},
                                      {"accepted.png", "accepted answers"},
                                      {"rejected.png", "rejected answers"}}) {
      const bool purifies = method->is_colored && stage2_of(*method, config_.run.stage2).purify.enabled;
      if (purifies && fs::exists(folder / file)) shown.galleries.push_back({title, read_picture(folder / file, "png")});
    }
    report.methods.push_back(std::move(shown));
  }
  return report;
}

/// The first shown view by every method beside the input and the truth, for documents.
fs::path Run::write_strip(const Subject& subject) const {
  const View& view = *subject.evaluated[subject.shown().front()];
  std::vector<Tile> tiles;
  tiles.push_back(tile_of(view.image.width, view.image.height, luminance_plane(view.image), "input"));
  for (const Method* method : plan_.methods) {
    const fs::path file = folder_of(subject, plan_.seeds.front()) / method->name / "views" / numbered(0);
    if (!method->is_colored || !fs::exists(file)) continue;
    const ColorImage image = load_color_image(file);
    tiles.push_back(tile_of(image.width, image.height, image.rgb, method->name));
  }
  if (const auto truth = load_color_truth(view)) {
    tiles.push_back(tile_of(truth->width, truth->height, truth->rgb, "truth"));
  }
  const fs::path file = plan_.report / ("strip-" + subject.name + ".png");
  write_png(file, tiled(tiles, kStripColumns));
  return file;
}

void Run::write_report() const {
  for (const auto& subject : subjects_) observer_.wrote("pictures", write_strip(*subject));
  std::vector<ReportCapture> captures;
  for (const auto& subject : subjects_) captures.push_back(report_of(*subject));
  write_file(plan_.report / "table.json", table_json(cells_, summary()).dump(2) + "\n");
  write_file(plan_.report / "table.md", table_markdown(cells_, summary()));
  write_file(plan_.report / "report.html", report_html(cells_, summary(), captures));
  for (const char* file : {"table.json", "table.md", "report.html"}) observer_.wrote("comparison", plan_.report / file);
}

void Run::write_rating_sheet() const {
  std::vector<RatedPicture> pictures;
  for (const auto& subject : subjects_) {
    const ReportCapture report = report_of(*subject);
    for (const ReportMethod& method : report.methods) {
      const bool is_bound = method.name == "grey" || method.name == "oracle";
      for (std::size_t v = 0; v < method.views.size() && !is_bound; ++v) {
        pictures.push_back({subject->name, report.views[v], method.name, method.views[v]});
      }
    }
  }
  const RatingSheet sheet = make_rating_sheet(std::move(pictures), std::uint64_t(plan_.seeds.front()));
  write_file(plan_.report / "rating_sheet.html", sheet.html);
  write_file(plan_.report / "rating_key.json", sheet.key);
  observer_.wrote("rating sheet, for raters", plan_.report / "rating_sheet.html");
  observer_.wrote("its key, not for raters", plan_.report / "rating_key.json");
}

}  // namespace cnerf::compare
