#include "src/colorizer/colorizer.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "src/base/check.h"
#include "src/color/ab_bins.h"
#include "src/colorizer/kinds.h"

namespace cnerf {
namespace {

struct Kind {
  const char* name;
  const char* argument;  ///< as shown in messages; empty = takes none
  std::unique_ptr<Colorizer> (*make)(const std::string& argument, const ColorizerOptions& options);
  bool needs_argument;
};

constexpr Kind kKinds[] = {
#ifdef CNERF_HAS_BUILTIN_COLORIZER
    {"builtin", "", make_builtin_colorizer, false},
#endif
    {"reference", "IMAGE[,IMAGE...]", make_reference_colorizer, true},
    {"torchscript", "FILE", make_torchscript_colorizer, true},
    {"onnx", "FILE", make_onnx_colorizer, true},
    {"caffe", "PROTO,MODEL", make_caffe_colorizer, true},
    {"exec", "COMMAND", make_exec_colorizer, true},
    {"grey", "", make_grey_colorizer, false},
};

std::string usage_of(const Kind& kind) {
  return *kind.argument == '\0' ? kind.name : std::string(kind.name) + ":" + kind.argument;
}

[[noreturn]] void refuse_spec(const std::string& spec) {
  if (spec.substr(0, spec.find(':')) == "simulated") {
    throw UsageError("colorizer \"" + spec + "\": knows the true colours, so only cnerf compare takes it");
  }
  std::string message = spec.empty() ? "no colorizer named" : "unknown colorizer \"" + spec + "\"";
  message += "; expected one of";
  for (const Kind& kind : kKinds) message += " " + usage_of(kind);
  throw UsageError(message);
}

class GreyColorizer final : public Colorizer {
 public:
  ChromaBatch colorize(const LightnessBatch& patches) override {
    ChromaBatch answer{patches.batch, patches.height, patches.width, {}, {}};
    answer.ab.assign(2 * patches.lightness.size(), 0.0f);
    return answer;
  }
  [[nodiscard]] std::string name() const override { return "grey"; }
};

std::string size_text(int batch, int height, int width) {
  return std::to_string(batch) + " patches of " + std::to_string(width) + "x" + std::to_string(height);
}

void check_values(const std::string& colorizer, const char* what, const std::vector<float>& values, int channels,
                  const ChromaBatch& answer) {
  const std::size_t expected =
      std::size_t(answer.batch) * std::size_t(channels) * std::size_t(answer.height) * std::size_t(answer.width);
  if (values.size() != expected) {
    throw ColorizerError(colorizer + ": expected " + std::to_string(expected) + " values of " + what + ", got " +
                         std::to_string(values.size()));
  }
  const auto bad = std::find_if_not(values.begin(), values.end(), [](float v) { return std::isfinite(v); });
  if (bad != values.end()) {
    throw ColorizerError(colorizer + ": " + what + " value " + std::to_string(bad - values.begin()) +
                         " is not a finite number");
  }
}

}  // namespace

std::vector<std::string> colorizer_kinds() {
  std::vector<std::string> names;
  for (const Kind& kind : kKinds) names.emplace_back(kind.name);
  return names;
}

std::unique_ptr<Colorizer> make_colorizer(const ColorizerOptions& options) {
  const std::size_t colon = options.spec.find(':');
  const std::string name = options.spec.substr(0, colon);
  const std::string argument = colon == std::string::npos ? "" : options.spec.substr(colon + 1);
  for (const Kind& kind : kKinds) {
    if (name != kind.name) continue;
    if (kind.needs_argument && argument.empty()) {
      throw UsageError("colorizer \"" + options.spec + "\": expected " + usage_of(kind));
    }
    if (!options.prompt.empty() && (name != "exec" || !takes_prompt(argument))) {
      throw UsageError("--prompt: colorizer \"" + options.spec +
                       "\" takes no text; only exec: commands with {prompt} in them do");
    }
    return kind.make(argument, options);
  }
  refuse_spec(options.spec);
}

std::unique_ptr<Colorizer> make_grey_colorizer(const std::string& argument, const ColorizerOptions& options) {
  if (!argument.empty()) throw UsageError("colorizer \"" + options.spec + "\": grey takes nothing after it");
  return std::make_unique<GreyColorizer>();
}

std::filesystem::path find_spec_file(const std::string& name, const ColorizerOptions& options) {
  const std::filesystem::path beside = options.working_folder / name;
  if (!options.working_folder.empty() && std::filesystem::exists(beside)) return beside;
  if (std::filesystem::exists(name)) return name;
  std::string message = "colorizer \"" + options.spec + "\": no file " + name;
  if (!options.working_folder.empty() && beside != name) message += ", nor " + beside.string();
  throw MissingInputError(message);
}

void check_answer(const std::string& colorizer, const LightnessBatch& question, const ChromaBatch& answer) {
  if (answer.batch != question.batch || answer.height != question.height || answer.width != question.width) {
    throw ColorizerError(colorizer + ": asked about " + size_text(question.batch, question.height, question.width) +
                         ", answered " + size_text(answer.batch, answer.height, answer.width));
  }
  if (answer.ab.empty() == answer.logits.empty() && !question.lightness.empty()) {
    throw ColorizerError(colorizer + ": expected either ab or a distribution over " + std::to_string(kAbBinCount) +
                         " bins, got " + (answer.ab.empty() ? "neither" : "both"));
  }
  if (answer.has_distribution()) {
    check_values(colorizer, "logits", answer.logits, kAbBinCount, answer);
  } else {
    check_values(colorizer, "ab", answer.ab, 2, answer);
  }
}

std::vector<float> ab_of(const ChromaBatch& answer, int index, float temperature) {
  CNERF_CHECK(index >= 0 && index < answer.batch, "entry " + std::to_string(index));
  const std::size_t pixels = std::size_t(answer.height) * std::size_t(answer.width);
  if (!answer.has_distribution()) {
    const float* first = answer.ab.data() + std::size_t(index) * 2 * pixels;
    return {first, first + 2 * pixels};
  }
  const float* logits = answer.logits.data() + std::size_t(index) * kAbBinCount * pixels;
  std::vector<float> ab(2 * pixels);
  std::array<float, kAbBinCount> of_pixel{};
  for (std::size_t i = 0; i < pixels; ++i) {
    for (std::size_t bin = 0; bin < kAbBinCount; ++bin) of_pixel[bin] = logits[bin * pixels + i];
    const Ab color = decode_annealed_mean(of_pixel, temperature);
    ab[i] = color.a;
    ab[pixels + i] = color.b;
  }
  return ab;
}

}  // namespace cnerf
