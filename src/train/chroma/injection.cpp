#include "src/train/chroma/injection.h"

#include <algorithm>

#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/base/rng.h"
#include "src/base/usage.h"
#include "src/optim/adam.h"

namespace cnerf {
namespace {

constexpr int kMostRejectedInARow = 400;
constexpr std::size_t kGrain = 256;  // pixels of a parallel piece of work
constexpr int kSkyStep = 4;          // of the pixels of an answer, one of so many along both axes tells of the sky

}  // namespace

double Classification::step(ColorModel& model, const ColoredPixels& pixels, float learning_rate) const {
  std::vector<SoftLabel> labels(pixels.colors.size());
  parallel_each(labels.size(), kGrain, [&](std::size_t i) { labels[i] = soft_label(pixels.colors[i]); });
  return model.chroma->step(pixels.samples, labels, pixels.weights, weights_, learning_rate);
}

PatchTraining::PatchTraining(Session& session, const Injection& injection, Questioner& questioner,
                             const Purifier& purifier, const KnownColorMap& known)
    : session_(session), injection_(injection), questioner_(questioner), purifier_(purifier), known_(known) {}

void PatchTraining::run() {
  const Stage2Options& options = session_.options;
  ColorModel& model = session_.model;
  if (model.sky.exists() && model.sky.is_grey()) model.sky.add(session_.views(), known_);
  ask_ahead(0);
  const bool asks = steps() < options.patches;  // otherwise galleries show what was asked before
  while (steps() < options.patches) {
    const Stopwatch waiting;
    const Answers answers = questioner_.next();
    model.report.waited_seconds += waiting.seconds();
    model.report.colorizer_seconds += answers.seconds;
    model.queries.front() += std::int64_t(answers.patches.size());
    std::vector<Lesson> lessons = lessons_of(answers.patches);
    ask_ahead(long(lessons.size()));
    parallel_tasks(lessons.size(), [&](std::size_t i) { lessons[i].pixels = pixels_of(lessons[i]); });
    for (const Lesson& lesson : lessons) {
      const float rate =
          decayed_rate(options.learning_rate, options.final_learning_rate, double(steps()) / options.patches);
      const double loss = injection_.step(model, lesson.pixels, rate);
      if (!lesson.pixels.colors.empty()) session_.loss = loss;  // a patch may show nothing of the scene
      if (model.sky.exists() && lesson.is_accepted) learn_sky(*lesson.patch);
    }
    session_.after_step("stage 2", "loss", steps(), options.patches);
  }
  if (model.sky.exists()) model.sky.refresh();
  if (asks && session_.ranks().is_first()) galleries_.write(session_.folder());
}

long PatchTraining::steps() const {
  return injection_.step_count(session_.model);
}

std::vector<PatchTraining::Lesson> PatchTraining::lessons_of(std::span<const AnsweredPatch> patches) {
  std::vector<char> is_accepted(patches.size());
  parallel_tasks(patches.size(), [&](std::size_t i) { is_accepted[i] = purifier_.accepts(patches[i].view()); });
  std::vector<Lesson> lessons;
  long step = steps();
  for (std::size_t i = 0; i < patches.size(); ++i) {
    if (!judge(patches[i], is_accepted[i]) || step >= session_.options.patches) continue;
    lessons.push_back({&patches[i], bool(is_accepted[i]), step++, {}});
  }
  return lessons;
}

void PatchTraining::ask_ahead(long steps_to_do) {
  const long left = session_.options.patches - steps() - steps_to_do;
  if (left <= 0) return;
  questioner_.ask_ahead(session_.model.queries.front(), int(std::min<long>(left, session_.options.colorizer_batch)));
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
      const float certainty = patch.certainty.empty() ? 1 : patch.certainty[at];
      session_.model.sky.add(view, std::size_t(row * view.width + column), {patch.ab[at], patch.ab[b + at]},
                             certainty_weight(certainty, session_.options.sure_colors));
    }
  }
}

/// Pixels of the patch with the answer's colours, or known ones; of a rejected patch only those; and known pixels of
/// all views.
ColoredPixels PatchTraining::pixels_of(const Lesson& lesson) const {
  const AnsweredPatch& patch = *lesson.patch;
  const Stage2Options& options = session_.options;
  const auto views = session_.views();
  const PatchPixels picked = pick_pixels(views[patch.place.view], patch, options.rays_per_patch,
                                         std::uint64_t(options.seed), std::uint64_t(lesson.step));
  std::vector<ViewPixel> places;
  ColoredPixels pixels;
  for (std::size_t i = 0; i < picked.pixels.size(); ++i) {
    const Ab* known = known_.find(patch.place.view, picked.pixels[i]);
    if (known == nullptr && !lesson.is_accepted) continue;
    places.push_back({std::uint32_t(patch.place.view), picked.pixels[i]});
    pixels.colors.push_back(known != nullptr ? *known : picked.colors[i]);
    pixels.weights.push_back(known != nullptr ? 1 : certainty_weight(picked.certainty[i], options.sure_colors));
  }
  add_known(lesson.step, places, pixels.colors);
  pixels.weights.resize(places.size(), 1);
  for (std::size_t i = 0; i < places.size(); ++i) {
    pixels.weights[i] *= views[places[i].view].opacity[places[i].pixel];
  }
  pixels.samples = pixel_samples(views, places);
  return pixels;
}

void PatchTraining::add_known(long step, std::vector<ViewPixel>& places, std::vector<Ab>& colors) const {
  const auto known = known_.places();
  if (known.empty()) return;
  const CounterRng rng(std::uint64_t(session_.options.seed) ^ named_stream("known"), std::uint64_t(step));
  for (std::uint64_t i = 0; i < std::uint64_t(session_.options.rays_per_patch); ++i) {
    const ViewPixel place = known[rng.below(i, std::uint32_t(known.size()))];
    places.push_back(place);
    colors.push_back(*known_.find(place.view, place.pixel));
  }
}

}  // namespace cnerf
