#include "src/compare/baselines/flow.h"

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "src/base/error.h"

namespace cnerf::compare {
namespace {

constexpr float kFlowTolerance = 1.5f;        // pixels the two ways may disagree by, one standard deviation
constexpr float kLightnessTolerance = 10.0f;  // L*, one standard deviation

cv::Mat channel_of(std::vector<float>& values, int index, int height, int width) {
  return {height, width, CV_32F, values.data() + std::size_t(index) * std::size_t(height) * std::size_t(width)};
}

/// For each pixel of `to`: where it was in `from`, as absolute coordinates, and how far that can be trusted.
struct Correspondence {
  cv::Mat map;    // [H, W] of (x, y)
  cv::Mat trust;  // [H, W] in [0, 1]
};

Correspondence correspondence(const cv::Mat& from, const cv::Mat& to) {
  cv::Mat from8, to8, back, forth;
  from.convertTo(from8, CV_8U, 2.55);
  to.convertTo(to8, CV_8U, 2.55);
  const auto flow = cv::DISOpticalFlow::create(cv::DISOpticalFlow::PRESET_MEDIUM);
  flow->calc(to8, from8, back);
  flow->calc(from8, to8, forth);

  Correspondence found{cv::Mat(to.size(), CV_32FC2), cv::Mat(to.size(), CV_32F)};
  for (int y = 0; y < to.rows; ++y) {
    for (int x = 0; x < to.cols; ++x) {
      found.map.at<cv::Vec2f>(y, x) = back.at<cv::Vec2f>(y, x) + cv::Vec2f(float(x), float(y));
    }
  }
  cv::Mat forth_there, lightness_there;
  cv::remap(forth, forth_there, found.map, {}, cv::INTER_LINEAR, cv::BORDER_CONSTANT, cv::Scalar(1e4, 1e4));
  cv::remap(from, lightness_there, found.map, {}, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  for (int y = 0; y < to.rows; ++y) {
    for (int x = 0; x < to.cols; ++x) {
      const cv::Vec2f round_trip = back.at<cv::Vec2f>(y, x) + forth_there.at<cv::Vec2f>(y, x);
      const float apart = std::hypot(round_trip[0], round_trip[1]) / kFlowTolerance;
      const float unlike = (to.at<float>(y, x) - lightness_there.at<float>(y, x)) / kLightnessTolerance;
      found.trust.at<float>(y, x) = std::exp(-0.5f * (apart * apart + unlike * unlike));
    }
  }
  return found;
}

}  // namespace

struct FlowColorizer::Memory {
  cv::Mat lightness, a, b;
};

FlowColorizer::FlowColorizer(std::unique_ptr<Colorizer> inner) : inner_(std::move(inner)) {}
FlowColorizer::~FlowColorizer() = default;

ChromaBatch FlowColorizer::colorize(const LightnessBatch& view) {
  if (view.batch != 1)
    throw ColorizerError(name() + ": expected one view at a time, got " + std::to_string(view.batch));
  const ChromaBatch answered = inner_->colorize(view);
  check_answer(inner_->name(), view, answered);
  ChromaBatch answer{1, view.height, view.width, ab_of(answered, 0), {}};
  cv::Mat lightness(view.height, view.width, CV_32F, const_cast<float*>(view.lightness.data()));
  cv::Mat a = channel_of(answer.ab, 0, view.height, view.width), b = channel_of(answer.ab, 1, view.height, view.width);

  if (memory_ && memory_->lightness.size() == lightness.size()) {
    const Correspondence found = correspondence(memory_->lightness, lightness);
    cv::Mat share = kCarriedShare * found.trust;
    for (const auto& [before, now] : {std::pair{&memory_->a, &a}, std::pair{&memory_->b, &b}}) {
      cv::Mat carried;
      cv::remap(*before, carried, found.map, {}, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
      *now += share.mul(carried - *now);  // in place: `answer.ab` is what it points to
    }
  }
  memory_ = std::make_unique<Memory>(Memory{lightness.clone(), a.clone(), b.clone()});
  return answer;
}

}  // namespace cnerf::compare
