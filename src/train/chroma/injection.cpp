#include "src/train/chroma/injection.h"

#include <algorithm>
#include <iterator>

#include "src/base/error.h"
#include "src/base/rng.h"
#include "src/base/usage.h"
#include "src/optim/adam.h"

namespace cnerf {
namespace {

constexpr int kMostRejectedInARow = 400;
constexpr int kSkyStep = 4;  // of the pixels of an answer, one of so many along both axes tells of the sky

}  // namespace

double Classification::step(ColorModel& model, const ColoredPixels& pixels, float learning_rate) const {
  std::vector<SoftLabel> labels;
  std::ranges::transform(pixels.colors, std::back_inserter(labels), soft_label);
  return model.chroma->step(pixels.samples, labels, pixels.weights, weights_, learning_rate);
}

PatchTraining::PatchTraining(Session& session, const Injection& injection, Questioner& questioner,
                             const Purifier& purifier, const KnownColorMap& known)
    : session_(session), injection_(injection), questioner_(questioner), purifier_(purifier), known_(known) {}

void PatchTraining::run() {
  const Stage2Options& options = session_.options;
  ColorModel& model = session_.model;
  if (model.sky.exists() && model.sky.is_grey()) model.sky.add(session_.views(), known_);
  questioner_.ask_ahead(model.queries.front());
  while (steps() < options.patches) {
    const Stopwatch waiting;
    const Answers answers = questioner_.next();
    model.report.waited_seconds += waiting.seconds();
    model.report.colorizer_seconds += answers.seconds;
    model.queries.front() += options.colorizer_batch;
    questioner_.ask_ahead(model.queries.front());
    for (const AnsweredPatch& patch : answers.patches) {
      const bool is_accepted = purifier_.accepts(patch.view());
      if (!judge(patch, is_accepted) || steps() >= options.patches) continue;
      const float rate =
          decayed_rate(options.learning_rate, options.final_learning_rate, double(steps()) / options.patches);
      const ColoredPixels pixels = pixels_of(patch, is_accepted);
      const double loss = injection_.step(model, pixels, rate);
      if (!pixels.colors.empty()) session_.loss = loss;  // a patch may show nothing of the scene
      if (model.sky.exists() && is_accepted) learn_sky(patch);
    }
    session_.after_step("stage 2", "loss", steps(), options.patches);
  }
  if (model.sky.exists()) model.sky.refresh();
  if (session_.ranks().is_first()) galleries_.write(session_.folder());
}

long PatchTraining::steps() const {
  return injection_.step_count(session_.model);
}

bool PatchTraining::judge(const AnsweredPatch& patch, bool is_accepted) {
  Stage2Report& report = session_.model.report;
  (is_accepted ? report.accepted : report.rejected) += 1;
  galleries_.remember(patch, is_accepted);
  rejected_in_a_row_ = is_accepted ? 0 : rejected_in_a_row_ + 1;
  const bool is_of_use = is_accepted || !known_.places().empty();  // what is known needs no answer
  if (!is_of_use && rejected_in_a_row_ >= kMostRejectedInARow) {
    throw ColorizerError(session_.colorizer.name() + ": " + std::to_string(rejected_in_a_row_) +
                         " answers in a row were rejected as unlike the base images; see bases.png, lower "
                         "stage2.purify.threshold, or pick other bases");
  }
  return is_of_use;
}

void PatchTraining::learn_sky(const AnsweredPatch& patch) {
  const PatchPlace& place = patch.place;
  const CachedView& view = session_.views()[place.view];
  const std::size_t side = std::size_t(patch.side), b = side * side;
  for (int y = 0; y < patch.side; y += kSkyStep) {
    for (int x = 0; x < patch.side; x += kSkyStep) {
      const int column = place.left + x * place.side / patch.side, row = place.top + y * place.side / patch.side;
      const std::size_t at = std::size_t(y) * side + std::size_t(x);
      session_.model.sky.add(view, std::size_t(row * view.width + column), {patch.ab[at], patch.ab[b + at]});
    }
  }
}

/// Pixels of the patch with the answer's colours, or known ones; of a rejected patch only those; and known pixels of
/// all views.
ColoredPixels PatchTraining::pixels_of(const AnsweredPatch& patch, bool is_accepted) const {
  const Stage2Options& options = session_.options;
  const auto views = session_.views();
  const PatchPixels picked = pick_pixels(views[patch.place.view], patch, options.rays_per_patch,
                                         std::uint64_t(options.seed), std::uint64_t(steps()));
  std::vector<ViewPixel> places;
  ColoredPixels pixels;
  for (std::size_t i = 0; i < picked.pixels.size(); ++i) {
    const Ab* known = known_.find(patch.place.view, picked.pixels[i]);
    if (known == nullptr && !is_accepted) continue;
    places.push_back({std::uint32_t(patch.place.view), picked.pixels[i]});
    pixels.colors.push_back(known != nullptr ? *known : picked.colors[i]);
  }
  add_known(places, pixels.colors);
  for (const ViewPixel& place : places) pixels.weights.push_back(views[place.view].opacity[place.pixel]);
  pixels.samples = pixel_samples(views, places);
  return pixels;
}

void PatchTraining::add_known(std::vector<ViewPixel>& places, std::vector<Ab>& colors) const {
  const auto known = known_.places();
  if (known.empty()) return;
  const CounterRng rng(std::uint64_t(session_.options.seed) ^ named_stream("known"), std::uint64_t(steps()));
  for (std::uint64_t i = 0; i < std::uint64_t(session_.options.rays_per_patch); ++i) {
    const ViewPixel place = known[rng.below(i, std::uint32_t(known.size()))];
    places.push_back(place);
    colors.push_back(*known_.find(place.view, place.pixel));
  }
}

}  // namespace cnerf
