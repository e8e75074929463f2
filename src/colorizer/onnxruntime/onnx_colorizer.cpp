// onnx:FILE through ONNX Runtime; docs/colorizers.md describes FILE.toml.

#include <fcntl.h>
#include <onnxruntime_cxx_api.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <future>
#include <vector>

#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/base/text.h"
#include "src/colorizer/kinds.h"
#include "src/colorizer/network_contract.h"

namespace cnerf {
namespace {

namespace fs = std::filesystem;

std::string version() {
  return "ONNX Runtime " + std::string(OrtGetApiBase()->GetVersionString());
}

/// One for the process, as the library wants it. Its messages are told as ours, once.
Ort::Env& environment() {
  static Ort::Env env(ORT_LOGGING_LEVEL_FATAL, "cnerf");
  return env;
}

/// Debian 13's library prints hundreds of lines ("Schema error: ... already registered") to standard error when it
/// opens its first network, in any program. What goes wrong is thrown, so nothing else is lost.
class WithoutStandardError {
 public:
  WithoutStandardError() : kept_(::dup(STDERR_FILENO)) {
    const int nowhere = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
    if (kept_ >= 0 && nowhere >= 0) ::dup2(nowhere, STDERR_FILENO);
    if (nowhere >= 0) ::close(nowhere);
  }
  ~WithoutStandardError() {
    if (kept_ < 0) return;
    ::dup2(kept_, STDERR_FILENO);
    ::close(kept_);
  }
  WithoutStandardError(const WithoutStandardError&) = delete;
  WithoutStandardError& operator=(const WithoutStandardError&) = delete;

 private:
  int kept_;
};

Ort::Session open_session(const std::string& name, const fs::path& file, int threads) {
  const WithoutStandardError quiet;
  try {
    Ort::SessionOptions options;
    options.SetIntraOpNumThreads(threads);
    options.SetGraphOptimizationLevel(GraphOptimizationLevel::ORT_ENABLE_ALL);
    return {environment(), file.c_str(), options};
  } catch (const Ort::Exception& error) {
    throw ColorizerError(name + ": " + version() + " cannot read it, or it is cut short: " + first_line(error.what()) +
                         "; export it with an opset that this version knows");
  }
}

/// Opened by a child first, since the library trusts the files that it reads.
Ort::Session checked_session(const std::string& name, const fs::path& file, double seconds) {
  // Stacks of many threads would count as memory of the child's.
  read_in_child([&] { (void)open_session(name, file, 1); }, seconds, file,
                name + ": is damaged: " + version() + " cannot stand or end reading it");
  return open_session(name, file, thread_count());
}

class OnnxColorizer final : public NetworkColorizer {
 public:
  OnnxColorizer(const fs::path& file, const std::string& shown, double timeout_seconds)
      : NetworkColorizer("onnx:" + shown, {file}),
        session_(checked_session(name_, file, timeout_seconds)),
        timeout_(timeout_seconds) {
    Ort::AllocatorWithDefaultOptions allocator;
    if (session_.GetInputCount() != 1) {
      throw ColorizerError(name_ + ": expected a network of one input, found " +
                           std::to_string(session_.GetInputCount()));
    }
    input_ = session_.GetInputNameAllocated(0, allocator).get();
    const std::vector<std::int64_t> shape = session_.GetInputTypeInfo(0).GetTensorTypeAndShapeInfo().GetShape();
    is_asked_singly_ = !shape.empty() && shape[0] == 1;
    std::vector<std::string> outputs;
    for (std::size_t i = 0; i < session_.GetOutputCount(); ++i) {
      outputs.emplace_back(session_.GetOutputNameAllocated(i, allocator).get());
    }
    output_ = contract_.layer.empty() && !outputs.empty() ? outputs.back() : contract_.layer;
    if (std::ranges::find(outputs, output_) == outputs.end()) {
      throw ColorizerError(name_ + ": has no output '" + output_ + "'; there are: " + joined(outputs, ", "));
    }
  }

 private:
  Planes run(const Planes& input) override {
    if (!is_asked_singly_ || input.batch == 1) return answer_to(input);
    Planes all;
    const std::size_t size = input.values.size() / std::size_t(input.batch);
    for (std::size_t i = 0; i < std::size_t(input.batch); ++i) {
      const auto begin = input.values.begin() + std::ptrdiff_t(i * size);
      const Planes one =
          answer_to({1, input.channels, input.height, input.width, {begin, begin + std::ptrdiff_t(size)}});
      all.channels = one.channels;
      all.height = one.height;
      all.width = one.width;
      all.batch += one.batch;
      all.values.insert(all.values.end(), one.values.begin(), one.values.end());
    }
    return all;
  }

  Planes answer_to(const Planes& input) {
    try {
      return planes_of(forward(input));
    } catch (const Ort::Exception& error) {
      throw ColorizerError(name_ + ": failed on an input of " + input.shape_text() + ": " + first_line(error.what()));
    }
  }

  /// A network may hold loops: one that takes too long is told to end, which it does after its current operator.
  Ort::Value forward(const Planes& input) {
    const std::int64_t shape[] = {input.batch, input.channels, input.height, input.width};
    const Ort::MemoryInfo memory = Ort::MemoryInfo::CreateCpu(OrtArenaAllocator, OrtMemTypeDefault);
    const Ort::Value question = Ort::Value::CreateTensor<float>(memory, const_cast<float*>(input.values.data()),
                                                                input.values.size(), shape, std::size(shape));
    const char* input_name = input_.c_str();
    const char* output_name = output_.c_str();
    Ort::RunOptions options;
    std::future<std::vector<Ort::Value>> answer = std::async(
        std::launch::async, [&] { return session_.Run(options, &input_name, &question, 1, &output_name, 1); });
    if (answer.wait_for(timeout_) == std::future_status::ready) return std::move(answer.get().front());
    options.SetTerminate();
    answer.wait();
    throw ColorizerError(name_ + ": gave no answer within the time of colorizer.timeout_seconds");
  }

  [[nodiscard]] Planes planes_of(const Ort::Value& answer) const {
    const bool is_float =
        answer.IsTensor() && answer.GetTensorTypeAndShapeInfo().GetElementType() == ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT;
    if (!is_float) throw ColorizerError(name_ + ": expected an answer of 32-bit floats");
    const std::vector<std::int64_t> shape = answer.GetTensorTypeAndShapeInfo().GetShape();
    if (shape.size() != 4) {
      throw ColorizerError(name_ + ": expected four dimensions, [B, C, H, W], got " + std::to_string(shape.size()));
    }
    const auto* values = answer.GetTensorData<float>();
    return {int(shape[0]),
            int(shape[1]),
            int(shape[2]),
            int(shape[3]),
            {values, values + answer.GetTensorTypeAndShapeInfo().GetElementCount()}};
  }

  Ort::Session session_;
  std::chrono::duration<double> timeout_;
  std::string input_, output_;
  bool is_asked_singly_ = false;  ///< exported for a batch of one
};

std::unique_ptr<Colorizer> make_colorizer_by_onnxruntime(const ColorizerRequest& request) {
  return std::make_unique<OnnxColorizer>(find_spec_file(request.argument, request), request.argument,
                                         request.options.timeout_seconds);
}

}  // namespace
}  // namespace cnerf

extern "C" __attribute__((visibility("default"))) const cnerf::OnnxRuntimeColorizers* cnerf_onnxruntime_colorizers() {
  static const std::string version = cnerf::version();
  static const cnerf::OnnxRuntimeColorizers colorizers{cnerf::make_colorizer_by_onnxruntime, version.c_str()};
  return &colorizers;
}
