#include "src/compare/subject.h"

#include <fmt/format.h>

#include <algorithm>

#include "src/base/error.h"
#include "src/capture/color_truth.h"
#include "src/evaluate/evaluate.h"
#include "src/pipeline/run_context.h"

namespace cnerf::compare {
namespace fs = std::filesystem;
namespace {

constexpr int kUsualHoldout = 8;  // where neither the capture nor the user says
constexpr std::size_t kShownViews = 4;

std::unique_ptr<Subject> read_subject(const ComparedCapture& compared, Config config, Observer& observer,
                                      const fs::path& report) {
  if (compared.downscale > 0) config.capture.downscale = compared.downscale;
  auto subject = std::make_unique<Subject>();
  if (config.capture.holdout == 0 &&
      std::ranges::none_of(survey_capture(compared.path, config.capture).views, &View::held_out)) {
    config.capture.holdout = kUsualHoldout;
    observer.say(fmt::format("nothing is held out by the capture: every {}th view is", kUsualHoldout));
  }
  subject->capture = pipeline::read_capture(compared.path, config, observer, report);
  subject->options = config.capture;
  subject->evaluated = views_to_evaluate(subject->capture, {});
  const View& first = *subject->evaluated.front();
  if (!load_color_truth(first)) {
    throw InputError(first.image_file, "colour", "methods are compared with true colours, and this picture is grey");
  }
  return subject;
}

}  // namespace

ComparedCapture parse_compared_capture(const std::string& text) {
  const std::size_t at = text.rfind('@');
  if (at == std::string::npos || fs::exists(text)) return {text, 0};
  const std::string digits = text.substr(at + 1);
  const bool is_number =
      !digits.empty() && digits.size() < 3 && digits.find_first_not_of("0123456789") == std::string::npos;
  if (!is_number || std::stoi(digits) < 1 || std::stoi(digits) > 64) {
    throw UsageError("CAPTURE: " + text + ": expected FOLDER@N, image sizes divided by N from 1 to 64");
  }
  return {text.substr(0, at), std::stoi(digits)};
}

std::vector<std::size_t> Subject::shown() const {
  std::vector<std::size_t> indices;
  const std::size_t count = std::min(evaluated.size(), kShownViews);
  for (std::size_t i = 0; i < count; ++i) indices.push_back(i * evaluated.size() / count);
  return indices;
}

std::vector<std::unique_ptr<const Subject>> read_subjects(const std::vector<ComparedCapture>& captures,
                                                          const Config& config, Observer& observer,
                                                          const fs::path& report) {
  std::vector<std::unique_ptr<const Subject>> subjects;
  for (const ComparedCapture& compared : captures) {
    auto subject = read_subject(compared, config, observer, report);
    const std::string name = fs::absolute(compared.path / "").lexically_normal().parent_path().filename().string();
    const auto is_taken = [&] {
      return std::ranges::any_of(subjects, [&](const auto& other) { return other->name == subject->name; });
    };
    subject->name = name;
    for (int copy = 2; is_taken(); ++copy) subject->name = fmt::format("{}-{}", name, copy);
    subjects.push_back(std::move(subject));
  }
  return subjects;
}

}  // namespace cnerf::compare
