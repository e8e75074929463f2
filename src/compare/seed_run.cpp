#include "src/compare/seed_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/json_record.h"
#include "src/colorizer/layers_model.h"
#include "src/compare/baselines/flow.h"
#include "src/compare/baselines/positional_field.h"
#include "src/compare/baselines/simulated.h"
#include "src/compare/contents.h"
#include "src/compare/derived_engines.h"
#include "src/compare/stage2_variants.h"
#include "src/picture/encode.h"
#include "src/pipeline/colorize_step.h"
#include "src/pipeline/picture_files.h"
#include "src/pipeline/render_step.h"
#include "src/pipeline/run_context.h"
#include "src/prepare/sparse_points.h"
#include "src/render/camera_path.h"
#include "src/train/chroma/color_model.h"
#include "src/train/luminance/luminance_model.h"
#include "src/train/luminance/options_json.h"
#include "src/train/luminance/placement.h"
#include "src/train/luminance/seen_sky.h"
#include "src/train/luminance/stage1.h"

namespace cnerf::compare {
namespace fs = std::filesystem;
namespace {

constexpr int kPictureWidth = 480;             // pixels
constexpr int kPictureQuality = 88;            // of JPEG
constexpr int kFrameQuality = 80;              // of a turntable's
constexpr std::size_t kLongRange = 8;          // the turntable's share that long-range consistency looks across
constexpr std::size_t kMeasuredPixels = 1024;  // of a learning curve: rendering them by an MLP takes seconds
constexpr double kPositionalBudget = 4;        // of the paper's field: training time in times of the hash grid's
constexpr double kStyleStepsPerPatch = 0.08;   // style transfer follows whole pictures, other methods patches
constexpr int kFewestStyleSteps = 8;
constexpr int kManySteps = 100'000'000;  // the time ends a training, not these

// Records of a cell, in its folder.
constexpr const char* kColored = "colored.json";  // until it is judged: what its training came to
constexpr const char* kJudged = "cell.json";

std::string digest(const std::string& text) {
  return sha256(std::as_bytes(std::span(text)));
}

/// The settings that a folder was made with; empty when it was not.
std::string settings_in(const fs::path& folder) {
  const fs::path file = folder / "settings.txt";
  return fs::exists(file) ? read_text_file(file) : "";
}

/// An empty folder unless it was made with these settings.
void begin_folder(const fs::path& folder, const std::string& settings) {
  if (settings_in(folder) == settings) return;
  remove_output(folder);
  write_file(folder / "settings.txt", settings);
}

/// Whether answers are built on those of the network that comes with the program.
bool asks_builtin(const Method& method, const ColorizerOptions& options) {
  const bool fits_reference = method.distills_key_view || options.spec.starts_with("reference:");
  return options.spec == "builtin" || (fits_reference && options.reference_on_builtin);
}

/// What decides a text's loss.
std::string text_of(const TextGuide& guide) {
  return guide.text.empty()
             ? ""
             : guide.text + " " + sha256_of_file(guide.image_encoder) + sha256_of_file(guide.text_encoder);
}

void write_jpeg(const fs::path& file, const RenderedImage& image, int quality) {
  const Picture picture = scaled_down(pipeline::picture_of(image, pipeline::ShownColor::kDecoded), kPictureWidth);
  write_file(file, std::span<const std::byte>(jpeg_bytes(picture, quality)));
}

std::string to_text(const std::vector<LearningPoint>& curve) {
  std::string text;
  for (const LearningPoint& point : curve) text += fmt::format("{:.6g} {:.6g}\n", point.seconds, point.value);
  return text;
}
std::vector<LearningPoint> read_curve(const fs::path& snapshot) {
  const fs::path file = fs::path(snapshot).replace_extension(".curve");
  std::vector<LearningPoint> curve;
  std::istringstream lines(fs::exists(file) ? read_text_file(file) : "");
  for (LearningPoint point; lines >> point.seconds >> point.value;) curve.push_back(point);
  return curve;
}

/// The light of the sky that stage 1 will find.
DirectionMap expected_sky(const Stage1Job& job) {
  if (!job.options.sky) return {};
  return find_sky(job.capture, training_views(job.capture, {}), job.known_points()).light;  // directions know no frame
}

/// Trains stage 1, and leaves the curve of its PSNR beside the snapshot.
/// @param image_memory  as Stage1Job has it
Stage1Report train_measured(const Subject& subject, const Stage1Options& options, const fs::path& snapshot,
                            std::size_t image_memory, const Engines& engines, Observer& observer) {
  Stage1Job job{subject.capture, options, snapshot, true};
  job.points = prepare::points_for_training(job, observer);
  job.image_memory = image_memory;
  const SceneFrame frame = job.goes_on() ? LuminanceModel::frame_in(snapshot)
                                         : place_scene(subject.capture, options.placement, job.known_points());
  const HeldOutPixels pixels(subject.evaluated, frame, kMeasuredPixels);
  const MarchSettings march = march_settings(frame.cascades, options.steps_per_box, options.cone_angle);
  const DirectionMap sky = expected_sky(job);
  const DirectionView light = sky.exists() ? sky.plane(0) : DirectionView();
  const WatchedEngines watched(engines);
  LearningCurve curve("stage 1", observer, [&] { return pixels.psnr(watched.luminance(), march, light); });
  const Stage1Report report = train_stage1(job, watched, curve);
  // The engine is gone; what it came to is in the snapshot. What an earlier part of the training took comes first.
  const double before = curve.points().empty() ? report.seconds : report.seconds - curve.seconds();
  std::vector<LearningPoint> points = curve.points();
  for (LearningPoint& point : points) point.seconds += std::max(before, 0.0);
  const LuminanceModel model = LuminanceModel::load(snapshot, engines);
  points.push_back({report.seconds, pixels.psnr(*model.engine, march, model.sky_light())});
  write_file(fs::path(snapshot).replace_extension(".curve"), to_text(points));
  return report;
}

bool is_own(const Method& method) {
  return &method == &kMethods[0];
}

}  // namespace

std::string numbered(std::size_t index) {
  return fmt::format("{:04}.jpg", index);
}

/// What a method's colours stand on.
struct SeedRun::Field {
  std::unique_ptr<const Engines> own;    ///< of a stage 1 of its own; null where it shares one
  std::unique_ptr<const Engines> mixed;  ///< of the shared stage 1, and of colours of its own
  const Engines* engines;                ///< of the shared stage 1 and of the colours
};

SeedRun::SeedRun(const Bench& bench, const Subject& subject, int seed, fs::path folder)
    : bench_(bench), subject_(subject), seed_(seed), folder_(std::move(folder)), stage1_(folder_ / "stage1.snapshot") {}

SeedRun::Field SeedRun::field_of(const Method& method) const {
  if (!method.has_own_field) return {nullptr, nullptr, &bench_.engines};
  const SceneFrame frame = LuminanceModel::frame_in(stage1_);
  Field field{positional_engines(positional_rays(subject_.capture, frame), bench_.engines), nullptr, nullptr};
  field.mixed = std::make_unique<MixedEngines>(bench_.engines, *field.own);
  field.engines = field.mixed.get();
  return field;
}

void SeedRun::train() {
  Stage1Options options = bench_.config.stage1;
  options.seed = seed_;
  options.exposures = options.poses = options.lenses = false;  // methods are compared on the views as given
  // Photographs may come or go between a comparison and its going on, and cameras may change.
  std::string views = digest_of_training(subject_.capture) + subject_.capture.cameras;
  for (const View* view : subject_.evaluated) views += "\n" + view->name;
  stage1_settings_ = digest(fs::absolute(subject_.capture.root).string() + views + options_to_json(options).dump() +
                            options_to_json(subject_.options).dump());
  files_ = content_of_spec(bench_.config.colorizer, subject_.capture.root) +
           (bench_.lpips != nullptr ? content_of(bench_.plan.lpips_weights) : "") +
           (bench_.encoder != nullptr ? content_of(encoder_folder()) : "");
  const fs::path done = folder_ / "stage1.txt";
  if (settings_in(folder_) == stage1_settings_ && fs::exists(done)) return;
  begin_folder(folder_, stage1_settings_);
  bench_.observer.say(fmt::format("{}, seed {}: stage 1", subject_.name, seed_));
  const Stage1Report report = train_measured(subject_, options, stage1_, pipeline::image_memory(bench_.config),
                                             bench_.engines, bench_.observer);
  write_file(done, fmt::format("{} steps, {:.1f} s, {:.2f} dB on training pixels\n", report.steps, report.seconds,
                               report.train_psnr));
}

std::string SeedRun::settings_of(const Method& method) const {
  const Config& run = bench_.config;
  const fs::path& style = bench_.plan.style_reference;
  return digest(stage1_settings_ + method.name + options_to_json(stage2_of(method, run.stage2)).dump() +
                (method.matches_features ? style.string() + content_of(style) : "") +
                (method.follows_text ? text_of(bench_.plan.text) : "") + options_to_json(run.colorizer).dump() +
                files_ + (asks_builtin(method, run.colorizer) ? content_of_builtin() : "") +
                options_to_json(run.render).dump() + (bench_.lpips != nullptr ? bench_.lpips->network() : "") +
                (bench_.encoder != nullptr ? "encoder" : ""));
}

/// Does a part of a cell's work. Where the method fails, the cell says why.
template <typename Part>
void SeedRun::attempt(Cell& cell, const Part& part) const {
  try {
    part();
  } catch (const Interrupted&) {
    throw;
  } catch (const OutputError&) {  // says nothing of the method
    throw;
  } catch (const std::exception& problem) {
    cell.error = problem.what();
    bench_.observer.say(fmt::format("{} failed: {}", cell.method, problem.what()));
  }
}

void SeedRun::color(const Method& method) {
  const fs::path folder = folder_ / method.name;
  const std::string settings = settings_of(method);
  if (settings_in(folder) == settings) {
    for (const char* file : {kJudged, kColored}) {
      if (!fs::exists(folder / file)) continue;
      if (read_record<Cell>(folder / file).error.empty()) return;
      remove_output(folder);  // what is left may be why it failed
    }
  }
  begin_folder(folder, settings);
  bench_.observer.say(fmt::format("{}, seed {}: {}", subject_.name, seed_, method.name));
  Cell cell;
  cell.capture = subject_.name;
  cell.method = method.name;
  cell.seed = seed_;
  cell.settings = settings;
  if (method.is_colored) attempt(cell, [&] { colorize(method, cell); });
  write_file(folder / kColored, json_of(cell).dump(2) + "\n");
}

Cell SeedRun::judge(const Method& method) const {
  const fs::path folder = folder_ / method.name;
  if (fs::exists(folder / kJudged)) return read_record<Cell>(folder / kJudged);
  auto cell = read_record<Cell>(folder / kColored);
  if (cell.error.empty()) {
    attempt(cell, [&] {
      const Field field = field_of(method);
      const fs::path take = method.is_colored ? folder / "take.snapshot" : fs::path();
      const auto scene = Scene::load(stage1_, take, *field.engines);
      evaluate_views(method, *scene, cell);
      evaluate_turntable(method, *scene, cell);
    });
  }
  write_file(folder / kJudged, json_of(cell).dump(2) + "\n");
  remove_output(folder / kColored);
  return cell;
}

std::unique_ptr<Colorizer> SeedRun::colorizer_for(const Method& method) const {
  if (method.knows_truth) return make_simulated_colorizer(subject_.capture, oracle_simulation());
  Config config = bench_.config;
  std::unique_ptr<Colorizer> colorizer;
  if (config.colorizer.spec == kSimulated) {
    SimulationOptions options;
    options.seed = seed_;  // each seed meets other errors
    colorizer = make_simulated_colorizer(subject_.capture, options);
  } else {
    config.stage2.seed = seed_;
    colorizer = make_colorizer(config.colorizer, pipeline::colorizer_context(config, subject_.capture.root,
                                                                             folder_ / "cache", bench_.observer));
  }
  if (!method.follows_flow) return colorizer;
  return std::make_unique<FlowColorizer>(std::move(colorizer));
}

/// Stage 1 of a method that has a field of its own: some times as long as the shared one took.
void SeedRun::train_own_field(const Engines& engines, Cell& cell) const {
  Stage1Options options = bench_.config.stage1;
  options.seed = seed_;
  options.steps = kManySteps;
  options.checkpoint_every = 0;
  options.max_seconds = kPositionalBudget * LuminanceModel::load(stage1_, bench_.engines).seconds;
  options.learning_rate = kPositionalLearningRate;
  options.final_learning_rate = kPositionalFinalLearningRate;
  const fs::path snapshot = folder_ / cell.method / "stage1.snapshot";
  (void)train_measured(subject_, options, snapshot, pipeline::image_memory(bench_.config), engines, bench_.observer);
  cell.stage1_curve = read_curve(snapshot);
}

/// Color3D's personalised colorizer: fitted to the view that tells most of the others, as `colorizer` colours it.
std::unique_ptr<Colorizer> SeedRun::distilled(const Method& method, Colorizer& colorizer) {
  Config config = bench_.config;
  const LuminanceModel luminance = LuminanceModel::load(stage1_, bench_.engines);
  training_views_.fill(luminance.seen(), subject_.capture, luminance.frame, config.stage2.working_resolution,
                       [&](double fraction) {
                         bench_.observer.report_progress({"looking at views", fraction, {}});
                       });
  const LightnessBatch question = key_view(training_views_);
  const ChromaBatch answer = colorizer.colorize(question);
  check_answer(colorizer.name(), question, answer);
  const fs::path file = folder_ / method.name / "key_view.png";
  write_png(file, picture_from_linear(question.width, question.height,
                                      linear_rgb_from_lab(question.lightness, ab_of(answer, 0))));
  config.colorizer.spec = "reference:" + fs::absolute(file).string();
  config.colorizer.prompt.clear();
  config.stage2.seed = seed_;
  return make_colorizer(config.colorizer, pipeline::colorizer_context(config, {}, {}, bench_.observer));
}

/// ARF or CLIP-NeRF in place of stage 2.
void SeedRun::follow_picture_loss(const Method& method, Colorizer& colorizer, Cell& cell) const {
  const Plan& plan = bench_.plan;
  Stage2Options options = stage2_of(method, bench_.config.stage2);
  options.seed = seed_;
  if (method.matches_features && plan.lpips_weights.empty()) {
    throw UsageError("style-transfer: needs a network of features: --lpips-weights of AlexNet");
  }
  if (method.follows_text && plan.text.text.empty()) {
    throw UsageError("clip-nerf: needs a text and encoders: --clip IMAGE.pt,TEXT.pt --clip-text TEXT");
  }
  LabPicture reference;
  if (method.matches_features) {
    reference = plan.style_reference.empty() ? colorized_view(subject_.capture, stage1_, colorizer, bench_.engines)
                                             : reference_image(plan.style_reference);
  }
  const auto loss = method.follows_text ? make_text_loss(plan.text) : make_style_loss(plan.lpips_weights, reference);
  cell.metrics.colorizer = method.follows_text ? "text:" + plan.text.text : colorizer.name();
  const std::string taken = method.follows_text ? cell.metrics.colorizer : "style:AlexNet";
  const int steps = std::max(kFewestStyleSteps, int(kStyleStepsPerPatch * options.patches));
  cell.seconds = transfer_style({subject_.capture, stage1_, *loss, method.follows_text ? nullptr : &reference, options,
                                 steps, folder_ / method.name / "take.snapshot", taken},
                                bench_.engines, bench_.observer);
}

void SeedRun::colorize(const Method& method, Cell& cell) {
  const Field field = field_of(method);
  if (field.own) train_own_field(*field.own, cell);
  if (is_own(method)) cell.stage1_curve = read_curve(stage1_);
  auto colorizer = colorizer_for(method);
  if (method.matches_features || method.follows_text) return follow_picture_loss(method, *colorizer, cell);
  if (method.distills_key_view) colorizer = distilled(method, *colorizer);
  train_colors(method, field, *colorizer, cell);
  cell.metrics.colorizer = colorizer->name();
}

/// Stage 2; of the own method and of those with a field of their own, also the curve of its ab error.
void SeedRun::train_colors(const Method& method, const Field& field, Colorizer& colorizer, Cell& cell) {
  Stage2Options options = stage2_of(method, bench_.config.stage2);
  options.seed = seed_;
  const fs::path take = folder_ / method.name / "take.snapshot";
  const auto temperature = float(options.decode_temperature);
  std::optional<HeldOutPixels> pixels;
  const WatchedEngines engines(*field.engines);
  LearningCurve curve("stage 2", bench_.observer, [&] { return pixels->ab_error(engines.color_bins(), temperature); });
  if (field.own || is_own(method)) {
    const LuminanceModel model = LuminanceModel::load(stage1_, bench_.engines);
    pixels.emplace(subject_.evaluated, model.frame, kMeasuredPixels);
    pixels->trace(*model.engine, model.march(), model.sky_light());
    remove_output(take);  // a curve is of one training from its beginning
  }
  const Photometric photometric;
  ViewQuestions whole_views(std::max(method.view_sizes, 1));
  const Stage2Job job{.capture = subject_.capture,
                      .stage1 = stage1_,
                      .options = options,
                      .colorizer = colorizer,
                      .known = {},
                      .take = take,
                      .resume = true,
                      .views = &training_views_,
                      .questions = method.view_sizes > 0 ? &whole_views : nullptr,
                      .injection = method.is_photometric ? &photometric : nullptr};
  const Stage2Report report = train_stage2(job, engines, pixels ? static_cast<Observer&>(curve) : bench_.observer);
  if (pixels && !curve.points().empty()) {
    cell.stage2_curve = curve.points();
    const ColorModel model = ColorModel::load(take, *field.engines);
    cell.stage2_curve.push_back({curve.seconds(), pixels->ab_error(*model.chroma, temperature)});
  }
  cell.accepted = report.accepted;
  cell.rejected = report.rejected;
  cell.seconds = report.seconds;
}

void SeedRun::evaluate_views(const Method& method, const Scene& scene, Cell& cell) const {
  EvaluateOptions options;
  options.render = pipeline::render_options(bench_.config);
  options.lpips = bench_.lpips;
  options.encoder = bench_.encoder;
  options.with_baked = false;
  options.grey_as_color = true;
  const std::vector<std::size_t> shown = subject_.shown();
  std::size_t index = 0;
  const auto keep_shown = [&](const EvaluatedView& view) {
    const auto place = std::ranges::find(shown, index++);
    if (place == shown.end()) return;
    const fs::path file = folder_ / method.name / "views" / numbered(std::size_t(place - shown.begin()));
    write_jpeg(file, view.ours, kPictureQuality);
  };
  const std::string colorizer = cell.metrics.colorizer;
  cell.metrics = evaluate(scene, subject_.capture, options, keep_shown, bench_.observer.progress_sink());
  cell.metrics.take = method.name;
  cell.metrics.colorizer = colorizer;
}

void SeedRun::evaluate_turntable(const Method& method, const Scene& scene, Cell& cell) const {
  const CameraPath path = turntable_path(subject_.capture, bench_.config.render);
  const RenderOptions options = pipeline::render_options(bench_.config);
  std::vector<RenderedImage> frames;
  std::vector<SeenView> seen;
  frames.reserve(path.cameras.size());
  for (const PathCamera& camera : path.cameras) {
    if (bench_.observer.is_cancelled()) throw Interrupted("comparison stopped");
    frames.push_back(scene.render(camera.intrinsics, camera.world_from_camera, options));
    write_jpeg(folder_ / method.name / "turntable" / numbered(frames.size() - 1), frames.back(), kFrameQuality);
    seen.push_back({&frames.back(), camera.intrinsics, camera.world_from_camera});
    bench_.observer.report_progress({"turntable", double(frames.size()) / double(path.cameras.size()), {}});
  }
  if (!method.is_colored) return;
  cell.short_range = consistency(seen, 1);
  cell.long_range = consistency(seen, std::max<std::size_t>(2, path.cameras.size() / kLongRange));
}

}  // namespace cnerf::compare
