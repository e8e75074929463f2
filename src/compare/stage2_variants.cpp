#include "src/compare/stage2_variants.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "src/base/usage.h"
#include "src/train/chroma/key_views.h"

namespace cnerf::compare {
namespace {

constexpr int kWholeViewPatches = 2;  // a whole view is shown with a short side of so many patch sides

}  // namespace

double Photometric::step(ColorModel& model, const ColoredPixels& pixels, float learning_rate) const {
  return model.chromaticity->step(pixels.samples, pixels.colors, pixels.weights, AbLoss::kSquared, learning_rate);
}

void ViewQuestions::prepare(Session& session) {
  const auto views = session.views();
  answers_.assign(views.size() * sizes_, {});
  double asked = 0;
  for (const std::size_t v : along_the_path(views)) {
    for (std::size_t size = 0; size < sizes_; ++size) {
      const Stopwatch watch;
      const int side = std::min(kWholeViewPatches * session.options.patch_size, views[v].short_side()) >> size;
      const std::size_t place = v * sizes_ + size;
      const LightnessBatch question = whole_view(views[v], session.names()[v], place, side);
      const ChromaBatch answer = session.colorizer.colorize(question);
      check_answer(session.colorizer.name(), question, answer);
      answers_[place] = at_view_size(views[v], question, ab_of(answer, 0));
      session.model.report.colorizer_seconds += watch.seconds();
      session.report("stage 2: colouring views", ++asked / double(answers_.size()));
    }
  }
}

void ViewQuestions::answer(const Session& session, std::span<AnsweredPatch> patches) {
  for (AnsweredPatch& patch : patches) {
    const std::size_t v = patch.place.view;
    const std::size_t size = patch.place.index % sizes_;
    patch.ab = patch_colors(session.views()[v], patch.place, patch.side, answers_[v * sizes_ + size]);
  }
}

LightnessBatch whole_view(const CachedView& view, const std::string& name, std::uint64_t query, int short_side) {
  const double factor = std::min(1.0, double(short_side) / view.short_side());
  const cv::Size size(std::max(2, int(std::lround(view.width * factor))),
                      std::max(2, int(std::lround(view.height * factor))));
  LightnessBatch question{1, size.height, size.width, std::vector<float>(std::size_t(size.area())), {}};
  const cv::Mat luminance(view.height, view.width, CV_32F, const_cast<float*>(view.luminance.data()));
  cv::Mat shown(size, CV_32F, question.lightness.data());
  cv::resize(luminance, shown, size, 0, 0, cv::INTER_AREA);
  for (float& value : question.lightness) value = std::clamp(lightness_from_luminance(value), 0.0f, 100.0f);
  question.origins.push_back({name, 0, 0, 1, 1, query});
  return question;
}

LightnessBatch key_view(const ViewCache& views) {
  const SeenSurfaces seen(views.views(), views.names());
  const std::vector<KeyView> chosen = choose_key_views(seen, scene_points(seen), {}, 1).chosen;
  const std::size_t v = chosen.empty() ? 0 : chosen.front().view;
  return whole_view(views.views()[v], views.names()[v], v, views.views()[v].short_side());
}

std::vector<float> at_view_size(const CachedView& view, const LightnessBatch& question, const std::vector<float>& ab) {
  const std::size_t pixels = std::size_t(view.width) * std::size_t(view.height);
  std::vector<float> out(2 * pixels);
  for (std::size_t c = 0; c < 2; ++c) {
    const cv::Mat answer(question.height, question.width, CV_32F,
                         const_cast<float*>(ab.data()) + c * question.lightness.size());
    cv::Mat whole(view.height, view.width, CV_32F, out.data() + c * pixels);
    cv::resize(answer, whole, whole.size(), 0, 0, cv::INTER_LINEAR);
  }
  return out;
}

std::vector<std::size_t> along_the_path(std::span<const CachedView> views) {
  std::vector<std::size_t> path, left(views.size());
  std::iota(left.begin(), left.end(), std::size_t(0));
  while (!left.empty()) {
    auto next = left.begin();
    if (!path.empty()) {
      const Vec3d here = views[path.back()].camera.origin;
      next = std::ranges::min_element(left, {}, [&](std::size_t v) { return length(views[v].camera.origin - here); });
    }
    path.push_back(*next);
    left.erase(next);
  }
  return path;
}

}  // namespace cnerf::compare
