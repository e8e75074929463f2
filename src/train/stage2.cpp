#include "src/train/stage2.h"

#include <algorithm>
#include <cmath>
#include <future>
#include <iterator>
#include <numeric>
#include <sstream>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/rng.h"
#include "src/base/usage.h"
#include "src/color/colorspace_math.h"
#include "src/picture/contact_sheet.h"
#include "src/picture/encode.h"
#include "src/train/color_model.h"
#include "src/train/luminance_model.h"
#include "src/train/options_json.h"
#include "src/train/patches.h"

namespace cnerf {
namespace {

constexpr int kBaseCandidates = 12;
constexpr int kDistillPixels = 8192;  // pixels a distillation step
constexpr double kDistillRate = 1e-2,
                 kFinalDistillRate = 1e-3;  // of its own: distances want smaller steps than classes
constexpr std::size_t kGalleryTiles = 20;
constexpr int kWholeViewPatches = 2;  // a whole view is shown with a short side of so many patch sides
// Patch indices of bases and of opinions about them, apart from training's.
constexpr std::uint64_t kFirstBaseIndex = std::uint64_t(1) << 32, kFirstOpinionIndex = std::uint64_t(1) << 33;
constexpr int kMostRejectedInARow = 400;
constexpr std::size_t kPreviews = 3;
constexpr int kPreviewSide = 120;  // pixels of the shorter side

float decayed(double from, double to, double fraction) {
  return float(from * std::pow(to / from, std::clamp(2.0 * fraction - 1.0, 0.0, 1.0)));
}

std::vector<std::string> training_view_names(const Capture& capture) {
  std::vector<std::string> names;
  for (const View& view : capture.views) {
    if (!view.held_out) names.push_back(view.name);
  }
  return names;
}

/// A patch that was shown to the colorizer, and what came back.
struct AnsweredPatch {
  PatchPlace place;
  RenderedPatch shown;
  std::vector<float> ab;  // [2, K, K]
};

struct Answers {
  std::vector<AnsweredPatch> patches;
  double seconds = 0;  ///< that rendering and colouring them took
};

/// One run of stage 2.
class Colorization {
 public:
  Colorization(const Stage2Job& job, const Engines& engines, Observer& observer)
      : job_(job),
        engines_(engines),
        observer_(observer),
        options_(job.options),
        colorizer_(job.colorizer),
        file_(job.take),
        views_(job.shared != nullptr ? *job.shared : own_views_) {}

  Stage2Report run() {
    start_or_resume(sha256_of_file(job_.stage1), colorizer_.name() + describe(job_.known));
    seconds_before_ = model_.report.seconds;
    cache_views(LuminanceModel::load(job_.stage1, engines_));
    names_ = training_view_names(job_.capture);
    known_ = KnownColorMap(views_, names_, job_.known);

    if (options_.questions == "views") ask_about_views();
    const std::vector<AnsweredPatch> bases = choose_bases();
    std::vector<ColorPatchView> base_views;
    for (const AnsweredPatch& base : bases) base_views.push_back(view_of(base));
    const Purifier purifier(options_.purify, base_views);
    measure_prior(bases);
    inject(purifier);
    if (!model_.is_photometric()) distill();
    measure_bake_distance();
    save();
    return model_.report;
  }

  void only_bases() {
    cache_views(LuminanceModel::load(job_.stage1, engines_));
    names_ = training_view_names(job_.capture);
    write_candidates(ask_candidates(), file_);
  }

 private:
  void start_or_resume(const std::string& stage1_digest, const std::string& source) {
    if (job_.resume && std::filesystem::exists(file_)) {
      model_ = ColorModel::load(file_, engines_);
      if (model_.stage1_sha256 != stage1_digest) {
        throw SnapshotError(file_.string() + ": colorizes another stage 1 snapshot; run without --resume");
      }
      if (model_.colorizer != source || options_to_json(model_.options) != options_to_json(options_)) {
        throw SnapshotError(file_.string() +
                            ": was made with another colorizer or other stage2 options; run with the "
                            "same ones, or without --resume");
      }
      return;
    }
    model_ = ColorModel::create(options_, engines_);
    model_.colorizer = source;
    model_.stage1_sha256 = stage1_digest;
  }

  void cache_views(const LuminanceModel& luminance) {
    const std::vector<TrainingView> views = training_views(job_.capture, luminance.frame);
    if (views.empty()) throw UsageError("capture.holdout: holds out every view; none is left to colorize");
    const MarchSettings march = luminance.march();
    if (observer_.wants_previews()) cache_previews(luminance);
    for (std::size_t v = views_.size(); v < views.size(); ++v) {
      views_.push_back(
          cache_view(*luminance.engine, march, views[v].camera, options_.working_resolution, options_.cached_weight));
      ignore_masked(views_.back(), *views[v].image);
      tell("stage 2: caching views", double(v + 1) / double(views.size()), {});
      stop_if_asked();
    }
  }

  /// Held-out views, small: what an observer may want to see.
  void cache_previews(const LuminanceModel& luminance) {
    for (const View& view : job_.capture.views) {
      if (!view.held_out || previews_.size() >= kPreviews) continue;
      const UnitCamera camera(view.intrinsics, view.world_from_camera, luminance.frame);
      previews_.push_back({view.name, cache_view(*luminance.engine, luminance.march(), camera, kPreviewSide, 0.95)});
    }
  }

  [[nodiscard]] PreviewPicture preview(std::size_t index) const {
    const auto& [name, view] = previews_[index % previews_.size()];
    PreviewPicture picture{name, view.width, view.height, {}, view.luminance};
    std::vector<ViewPixel> all(view.luminance.size());
    for (std::size_t p = 0; p < all.size(); ++p) all[p].pixel = std::uint32_t(p);
    const std::vector<Ab> colors = model_.decode(pixel_samples(std::span(&view, 1), all));
    for (std::size_t p = 0; p < all.size(); ++p) {
      const Ab ab = view.opacity[p] < kLeastColoredOpacity ? Ab{} : colors[p];
      const Vec3f rgb = linear_rgb_at(view.luminance[p], ab);
      picture.ours.insert(picture.ours.end(), {rgb.x, rgb.y, rgb.z});
    }
    return picture;
  }

  [[nodiscard]] Answers ask(const std::vector<PatchPlace>& places) const {
    const Stopwatch watch;
    const int k = options_.patch_size;
    LightnessBatch question{int(places.size()), k, k, {}};
    std::vector<AnsweredPatch> answered;
    for (const PatchPlace& place : places) {
      const CachedView& view = views_[place.view];
      answered.push_back({place, render_patch(view, place, k), {}});
      if (!view_answers_.empty()) answered.back().ab = patch_colors(view, place, k, view_answers_[place.view]);
      const std::vector<float>& lightness = answered.back().shown.lightness;
      question.lightness.insert(question.lightness.end(), lightness.begin(), lightness.end());
      const double w = view.width, h = view.height;
      question.origins.push_back(
          {names_[place.view], place.left / w, place.top / h, place.side / w, place.side / h, place.index});
    }
    if (!view_answers_.empty()) return {std::move(answered), watch.seconds()};
    const ChromaBatch answer = colorizer_.colorize(question);
    check_answer(colorizer_.name(), question, answer);
    for (std::size_t i = 0; i < answered.size(); ++i) answered[i].ab = ab_of(answer, int(i));
    return {std::move(answered), watch.seconds()};
  }

  [[nodiscard]] ColorPatchView view_of(const AnsweredPatch& patch) const {
    return {options_.patch_size, options_.patch_size, patch.ab, patch.shown.lightness, patch.shown.opacity};
  }

  /// Shows the colorizer each view whole and once. They come along the path of the cameras, so that a colorizer that
  /// remembers can carry colours on from one view to the next.
  void ask_about_views() {
    view_answers_.resize(views_.size());
    double asked = 0;
    for (const std::size_t v : along_the_path(views_)) {
      const Stopwatch watch;
      const CachedView& view = views_[v];
      const LightnessBatch question = whole_view(view, names_[v], v, kWholeViewPatches * options_.patch_size);
      const ChromaBatch answer = colorizer_.colorize(question);
      check_answer(colorizer_.name(), question, answer);
      view_answers_[v] = at_view_size(view, question, ab_of(answer, 0));
      model_.report.colorizer_seconds += watch.seconds();
      tell("stage 2: colouring views", ++asked / double(views_.size()), {});
      stop_if_asked();
    }
  }

  /// Base patches (paper: s = 0.7, 5 images): parts of the key frames, whose colours are known; without any, answers of
  /// the colorizer, those that a user picked or the most typical ones.
  std::vector<AnsweredPatch> choose_bases() {
    if (!known_.key_frames().empty()) return bases_of_key_frames();
    const PurifyOptions& purify = options_.purify;
    if (purify.enabled && purify.picked_bases.empty() && purify.opinions > 1) return typical_bases();
    const std::vector<AnsweredPatch> answered = ask_candidates();
    write_candidates(answered, file_.parent_path() / "bases.png");
    std::vector<AnsweredPatch> bases;
    for (const int index : picked_bases(int(answered.size()))) bases.push_back(answered[std::size_t(index)]);
    return bases;
  }

  /// Where nobody picks: the most typical of all answers about all places says what the colours are, and of each place
  /// the answer most like that one is its base. So places cannot disagree with each other.
  std::vector<AnsweredPatch> typical_bases() {
    const std::vector<int> places = picked_bases(candidate_count());
    const int opinions = options_.purify.opinions;
    std::vector<PatchPlace> asked;
    for (const int candidate : places) {
      const PatchPlace place = candidate_place(candidate);
      asked.push_back(place);
      for (int i = 1; i < opinions; ++i) {
        asked.push_back(near_patch(views_, place, std::uint64_t(options_.seed), kFirstOpinionIndex + asked.size()));
      }
    }
    const std::vector<AnsweredPatch> answered = ask_all(asked);
    std::vector<ColorPatchView> views;
    for (const AnsweredPatch& answer : answered) views.push_back(view_of(answer));
    const std::size_t typical = most_typical(options_.purify, views);
    const Purifier like_it(options_.purify, std::span(views).subspan(typical, 1));
    std::vector<AnsweredPatch> bases;
    std::vector<Tile> tiles;
    for (auto of_place = answered.begin(); of_place != answered.end(); of_place += opinions) {
      const auto likeness = [&](const AnsweredPatch& answer) { return like_it.similarity(view_of(answer)); };
      bases.push_back(*std::ranges::max_element(of_place, of_place + opinions, {}, likeness));
      tiles.push_back(tile_of(bases.back(), "of " + std::to_string(opinions)));
    }
    write_png(file_.parent_path() / "bases.png", tiled(tiles));
    return bases;
  }

  std::vector<AnsweredPatch> bases_of_key_frames() {
    std::vector<AnsweredPatch> bases;
    const auto frames = known_.key_frames();
    for (int i = 0; i < options_.purify.base_images; ++i) {
      const KnownColorMap::KeyFrame& frame = frames[std::size_t(i) % frames.size()];
      const PatchPlace place = base_patch(frame.view, i);
      const int k = options_.patch_size;
      bases.push_back(
          {place, render_patch(views_[frame.view], place, k), patch_colors(views_[frame.view], place, k, frame.ab)});
    }
    write_candidates(bases, file_.parent_path() / "bases.png");
    return bases;
  }

  [[nodiscard]] PatchPlace base_patch(std::size_t view, int index) const {
    return random_patch(views_, view, options_.purify.base_scale, options_.purify.base_scale,
                        std::uint64_t(options_.seed), kFirstBaseIndex + std::uint64_t(index));
  }

  [[nodiscard]] int candidate_count() const { return std::max(kBaseCandidates, options_.purify.base_images); }
  /// Spread evenly over the views, so that they cover a 360 capture's directions.
  [[nodiscard]] PatchPlace candidate_place(int candidate) const {
    return base_patch(std::size_t(candidate) * views_.size() / std::size_t(candidate_count()), candidate);
  }
  std::vector<AnsweredPatch> ask_candidates() {
    std::vector<PatchPlace> places;
    for (int i = 0; i < candidate_count(); ++i) places.push_back(candidate_place(i));
    return ask_all(places);
  }

  std::vector<AnsweredPatch> ask_all(const std::vector<PatchPlace>& places) {
    std::vector<AnsweredPatch> answered;
    for (std::size_t first = 0; first < places.size(); first += std::size_t(options_.colorizer_batch)) {
      const auto last = std::min(places.size(), first + std::size_t(options_.colorizer_batch));
      Answers answers = ask({places.begin() + long(first), places.begin() + long(last)});
      model_.report.colorizer_seconds += answers.seconds;
      std::ranges::move(answers.patches, std::back_inserter(answered));
    }
    return answered;
  }

  void write_candidates(const std::vector<AnsweredPatch>& patches, const std::filesystem::path& file) const {
    std::vector<Tile> tiles;
    for (std::size_t i = 0; i < patches.size(); ++i) tiles.push_back(tile_of(patches[i], "base " + std::to_string(i)));
    write_png(file, tiled(tiles));
  }

  [[nodiscard]] std::vector<int> picked_bases(int candidates) const {
    std::vector<int> picked;
    if (options_.purify.picked_bases.empty()) {
      for (int i = 0; i < options_.purify.base_images; ++i)
        picked.push_back(i * candidates / options_.purify.base_images);
      return picked;
    }
    std::stringstream list(options_.purify.picked_bases);
    for (std::string item; std::getline(list, item, ',');) {
      const bool digits = !item.empty() && item.find_first_not_of("0123456789") == std::string::npos;
      const int index = digits && item.size() < 6 ? std::stoi(item) : -1;
      if (index < 0 || index >= candidates) {
        throw UsageError("stage2.purify.picked_bases: '" + item + "' is not a candidate, 0 to " +
                         std::to_string(candidates - 1));
      }
      picked.push_back(index);
    }
    return picked;
  }

  /// Class rebalancing's weights, from the colours of the base patches.
  void measure_prior(const std::vector<AnsweredPatch>& bases) {
    if (options_.rebalancing <= 0) return;
    std::vector<float> prior(kAbBinCount, 1e-6f);
    const std::size_t n = std::size_t(options_.patch_size) * std::size_t(options_.patch_size);
    for (const AnsweredPatch& base : bases) {
      for (std::size_t i = 0; i < n; ++i) {
        prior[std::size_t(nearest_bin({base.ab[i], base.ab[n + i]}))] += base.shown.opacity[i];
      }
    }
    const float total = std::accumulate(prior.begin(), prior.end(), 0.0f);
    for (float& p : prior) p /= total;
    class_weights_ = rebalancing_weights(prior, float(options_.rebalancing));
  }

  /// The colorizer answers about patches `first`, `first` + 1, … while others are trained on. One query is under way at
  /// a time; which patches it shows depends on their numbers alone.
  [[nodiscard]] std::future<Answers> ask_ahead(std::int64_t first) {
    return std::async(std::launch::async, [this, first] {
      std::vector<PatchPlace> places;
      for (int i = 0; i < options_.colorizer_batch; ++i) {
        const auto index = std::uint64_t(first + i);
        const CounterRng rng(std::uint64_t(options_.seed), index);
        places.push_back(random_patch(views_, rng.below(0, std::uint32_t(views_.size())), options_.scale_min,
                                      options_.scale_max, std::uint64_t(options_.seed), index));
      }
      return ask(places);
    });
  }

  /// Query-based colorization: draw, ask, purify, train on what passes.
  void inject(const Purifier& purifier) {
    int rejected_in_a_row = 0;
    std::future<Answers> coming = ask_ahead(model_.queries.front());
    while (steps() < options_.patches) {
      const Stopwatch waiting;
      const Answers answers = coming.get();
      model_.report.waited_seconds += waiting.seconds();
      model_.report.colorizer_seconds += answers.seconds;
      model_.queries.front() += options_.colorizer_batch;
      coming = ask_ahead(model_.queries.front());
      for (const AnsweredPatch& patch : answers.patches) {
        const bool is_accepted = purifier.accepts(view_of(patch));
        (is_accepted ? model_.report.accepted : model_.report.rejected) += 1;
        remember(is_accepted ? accepted_ : rejected_, patch);
        rejected_in_a_row = is_accepted ? 0 : rejected_in_a_row + 1;
        // What is known needs no answer.
        const bool is_of_use = is_accepted || !known_.places().empty();
        if (!is_of_use && rejected_in_a_row >= kMostRejectedInARow) {
          throw ColorizerError(colorizer_.name() + ": " + std::to_string(rejected_in_a_row) +
                               " answers in a row were rejected as unlike the base images; see bases.png, lower "
                               "stage2.purify.threshold, or pick other bases");
        }
        if (is_of_use && steps() < options_.patches) train_on(patch, is_accepted);
      }
      after_step(steps(), options_.patches);
    }
    write_png(file_.parent_path() / "accepted.png", tiled(accepted_));
    write_png(file_.parent_path() / "rejected.png", tiled(rejected_));
  }

  /// Patches trained on so far.
  [[nodiscard]] long steps() const {
    return model_.is_photometric() ? model_.chromaticity->step_count() : model_.chroma->step_count();
  }

  /// @param is_accepted  false: only what is known is trained on
  void train_on(const AnsweredPatch& patch, bool is_accepted) {
    const CachedView& view = views_[patch.place.view];
    const auto step = std::uint64_t(steps());
    const PatchPixels picked = pick_pixels(view, patch.place, options_.patch_size, patch.ab, options_.rays_per_patch,
                                           std::uint64_t(options_.seed), step);
    std::vector<ViewPixel> wanted;
    std::vector<Ab> colors;
    std::vector<float> weights;
    const auto want = [&](ViewPixel place, Ab color) {
      wanted.push_back(place);
      colors.push_back(color);
      const float of_class = class_weights_.empty() ? 1.0f : class_weights_[std::size_t(nearest_bin(color))];
      weights.push_back(of_class * views_[place.view].opacity[place.pixel]);
    };
    for (std::size_t i = 0; i < picked.pixels.size(); ++i) {
      const Ab* known = known_.find(patch.place.view, picked.pixels[i]);
      if (known == nullptr && !is_accepted) continue;
      want({std::uint32_t(patch.place.view), picked.pixels[i]}, known != nullptr ? *known : picked.colors[i]);
    }
    if (const auto places = known_.places(); !places.empty()) {
      const CounterRng rng(std::uint64_t(options_.seed) ^ named_stream("known"), step);
      const auto count = std::uint64_t(options_.known_share * options_.rays_per_patch);
      for (std::uint64_t i = 0; i < count; ++i) {
        const ViewPixel place = places[rng.below(i, std::uint32_t(places.size()))];
        want(place, *known_.find(place.view, place.pixel));
      }
    }
    const PixelSamples pixels = pixel_samples(views_, wanted);
    const float rate = decayed(options_.learning_rate, options_.final_learning_rate, double(step) / options_.patches);
    if (model_.is_photometric()) {
      loss_ = model_.chromaticity->step(pixels, colors, weights, AbLoss::kSquared, rate);
    } else {
      std::vector<SoftLabel> labels;
      std::ranges::transform(colors, std::back_inserter(labels), soft_label);
      loss_ = model_.chroma->step(pixels, labels, weights,
                                  {float(options_.spread_weight), float(options_.regression_weight)}, rate);
    }
  }

  /// Random visible pixels of all views.
  [[nodiscard]] PixelSamples random_pixels(int count, std::uint64_t stream) const {
    const CounterRng rng(std::uint64_t(options_.seed) ^ named_stream("dist"), stream);
    std::vector<ViewPixel> wanted;
    for (int i = 0; i < count; ++i) {
      const std::uint32_t v = rng.below(2 * std::uint64_t(i), std::uint32_t(views_.size()));
      const CachedView& view = views_[v];
      const std::uint32_t pixel = rng.below(2 * std::uint64_t(i) + 1, std::uint32_t(view.width * view.height));
      if (view.opacity[pixel] >= kLeastColoredOpacity) wanted.push_back({v, pixel});
    }
    return pixel_samples(views_, wanted);
  }

  /// Fits the per-sample colour to the pixels' decoded colours (what is baked is what is seen).
  void distill() {
    while (model_.chromaticity->step_count() < options_.distill_steps) {
      const long step = model_.chromaticity->step_count();
      const PixelSamples pixels = random_pixels(kDistillPixels, std::uint64_t(step));
      if (pixels.pixels() == 0) break;
      const double fraction = double(step) / options_.distill_steps;
      loss_ =
          model_.chromaticity->step(pixels, model_.decode(pixels), decayed(kDistillRate, kFinalDistillRate, fraction));
      after_step(step + 1, options_.distill_steps);
    }
  }

  void measure_bake_distance() {
    const PixelSamples pixels = random_pixels(4 * kDistillPixels, std::uint64_t(1) << 40);
    const std::vector<Ab> decoded = model_.decode(pixels);
    std::vector<Ab> baked(pixels.pixels());
    model_.chromaticity->composite(pixels, baked);
    double total = 0;
    for (std::size_t p = 0; p < baked.size(); ++p)
      total += std::hypot(baked[p].a - decoded[p].a, baked[p].b - decoded[p].b);
    model_.report.bake_ab_distance = total / double(std::max<std::size_t>(baked.size(), 1));
  }

  void after_step(long done, int all) {
    const bool distilling = !model_.is_photometric() && model_.chromaticity->step_count() > 0;
    const int asked = model_.report.accepted + model_.report.rejected;
    tell(distilling ? "stage 2: colour for baking" : "stage 2", double(done) / all,
         {{distilling ? "ab distance" : "loss", loss_},
          {"accepted", double(model_.report.accepted) / std::max(asked, 1)},
          {"waited s", model_.report.waited_seconds}});
    stop_if_asked();
  }

  void tell(const std::string& task, double fraction, std::vector<std::pair<std::string, double>> figures) const {
    const Stopwatch telling;
    observer_.report_progress({task, std::min(fraction, 1.0), std::move(figures)});
    if (!previews_.empty()) observer_.offer_preview([this](std::size_t index) { return preview(index); });
    told_seconds_ += telling.seconds();
  }

  void stop_if_asked() {
    if (!observer_.is_cancelled()) return;
    save();
    throw Interrupted("stopped; saved " + file_.string() + ", continue with --resume");
  }

  void save() {
    model_.report.seconds = seconds_before_ + watch_.seconds() - told_seconds_;
    model_.save(file_);
  }

  [[nodiscard]] Tile tile_of(const AnsweredPatch& patch, std::string caption) const {
    const int side = options_.patch_size;
    return {picture_from_linear(side, side, linear_rgb_from_lab(patch.shown.lightness, patch.ab)), std::move(caption)};
  }

  void remember(std::vector<Tile>& tiles, const AnsweredPatch& patch) const {
    if (tiles.size() < kGalleryTiles) tiles.push_back(tile_of(patch, ""));
  }

  const Stage2Job& job_;
  const Engines& engines_;
  Observer& observer_;
  const Stage2Options& options_;
  Colorizer& colorizer_;
  std::filesystem::path file_;
  ColorModel model_;
  std::vector<CachedView> own_views_;
  std::vector<CachedView>& views_;
  std::vector<std::string> names_;                // of the views
  std::vector<std::vector<float>> view_answers_;  // [2, H, W] of each view; empty: patches are asked about
  KnownColorMap known_;
  std::vector<float> class_weights_;  // [313]; empty = all alike
  std::vector<Tile> accepted_, rejected_;
  double loss_ = 0;
  Stopwatch watch_;
  double seconds_before_ = 0;
  mutable double told_seconds_ = 0;  // an observer's pauses and pictures are no training
  std::vector<std::pair<std::string, CachedView>> previews_;
};

}  // namespace

Stage2Report train_stage2(const Stage2Job& job, const Engines& engines, Observer& observer) {
  return Colorization(job, engines, observer).run();
}

void write_base_candidates(const Stage2Job& job, const Engines& engines, Observer& observer) {
  Colorization(job, engines, observer).only_bases();
}

}  // namespace cnerf
