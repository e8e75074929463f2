#include "src/colorizer/colorizer.h"

#include "src/base/error.h"
#include "src/base/plugin.h"
#include "src/colorizer/kinds.h"
#include "src/colorizer/layers_model.h"

namespace cnerf {
namespace {

const TorchColorizers& torch_colorizers() {
  return plugin_table<TorchColorizers>("torch", "cnerf_torch_colorizers");
}

template <MakeColorizer* TorchColorizers::*Make>
std::unique_ptr<Colorizer> make_by_torch(const ColorizerRequest& request) {
  return (torch_colorizers().*Make)(request);
}

/// The engine of onnx: networks; null: OpenCV.
const OnnxRuntimeColorizers* onnx_runtime() {
#if CNERF_ONNXRUNTIME
  return &plugin_table<OnnxRuntimeColorizers>("onnxruntime", "cnerf_onnxruntime_colorizers");
#else
  return nullptr;
#endif
}

std::unique_ptr<Colorizer> make_onnx(const ColorizerRequest& request) {
  const OnnxRuntimeColorizers* runtime = onnx_runtime();
  return runtime != nullptr ? runtime->onnx(request) : make_onnx_colorizer(request);
}

struct Kind {
  const char* name;
  const char* argument;  ///< as shown in messages; empty = takes none
  MakeColorizer* make;
  bool needs_argument;
};

constexpr Kind kKinds[] = {
    {"builtin", "", make_by_torch<&TorchColorizers::builtin>, false},
    {"reference", "IMAGE[,IMAGE...]", make_by_torch<&TorchColorizers::reference>, true},
    {"torchscript", "FILE", make_by_torch<&TorchColorizers::torchscript>, true},
    {"onnx", "FILE", make_onnx, true},
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

}  // namespace

std::unique_ptr<Colorizer> make_colorizer(const ColorizerOptions& options, const ColorizerContext& context) {
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
    return kind.make({argument, options, context});
  }
  refuse_spec(options.spec);
}

std::unique_ptr<PictureEncoder> make_picture_encoder() {
  return is_encoder_installed() ? torch_colorizers().encoder() : nullptr;
}

std::string torch_version() {
  return torch_colorizers().version;
}

std::string onnx_engine() {
  const OnnxRuntimeColorizers* runtime = onnx_runtime();
  return runtime != nullptr ? runtime->version : "OpenCV";
}

std::unique_ptr<Colorizer> make_grey_colorizer(const ColorizerRequest& request) {
  if (!request.argument.empty()) {
    throw UsageError("colorizer \"" + request.options.spec + "\": grey takes nothing after it");
  }
  return std::make_unique<GreyColorizer>();
}

}  // namespace cnerf
