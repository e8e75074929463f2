// onnx:FILE and caffe:PROTO,MODEL through OpenCV's dnn module; docs/colorizers.md describes FILE.toml.

#include <opencv2/core/utils/logger.hpp>
#include <opencv2/dnn.hpp>
#include <stdexcept>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/colorizer/kinds.h"
#include "src/colorizer/network_contract.h"
#include "src/colorizer/onnx_tensors.h"

namespace cnerf {
namespace {

namespace fs = std::filesystem;

/// What OpenCV, or the standard library below it, has just thrown; a lack of memory goes on.
std::string complaint() {
  try {
    throw;
  } catch (const cv::Exception& error) {
    return first_line(error.err);
  } catch (const std::logic_error& error) {  // of vectors that a damaged file makes too long
    return first_line(error.what());
  }
}

class DnnColorizer final : public NetworkColorizer {
 public:
  DnnColorizer(std::string name, const std::vector<fs::path>& files, const cv::dnn::Net& network)
      : NetworkColorizer(std::move(name), files), network_(network) {
    network_.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
    network_.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
  }

 private:
  Planes run(const Planes& input) override {
    const int shape[] = {input.batch, input.channels, input.height, input.width};
    cv::Mat answer;
    try {
      network_.setInput(cv::Mat(4, shape, CV_32F, const_cast<float*>(input.values.data())));
      answer = contract_.layer.empty() ? network_.forward() : network_.forward(contract_.layer);
    } catch (...) {
      throw ColorizerError(name_ + ": failed on an input of " + input.shape_text() + ": " + complaint());
    }
    if (answer.dims != 4 || answer.type() != CV_32F) {
      throw ColorizerError(name_ + ": expected four dimensions, [B, C, H, W], got " + std::to_string(answer.dims));
    }
    const auto* values = answer.ptr<float>();
    return {answer.size[0], answer.size[1], answer.size[2], answer.size[3], {values, values + answer.total()}};
  }

  cv::dnn::Net network_;
};

/// @param files   of the network; the last one has its weights
/// @param advice  what helps most users whose file is refused
template <typename Read>
std::unique_ptr<Colorizer> read_network(const ColorizerRequest& request, const std::string& name,
                                        const std::vector<fs::path>& files, const std::string& advice,
                                        const Read& read) {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);  // its errors are told as ours, once
  const auto network = [&] {
    try {
      return read();
    } catch (const Error&) {
      throw;
    } catch (...) {
      throw ColorizerError(name + ": OpenCV " CV_VERSION " cannot read it, or it is cut short: " + complaint() + "; " +
                           advice);
    }
  };
  read_in_child([&] { (void)network(); }, request.options.timeout_seconds, files.back(),
                name + ": is damaged: OpenCV " CV_VERSION " cannot stand or end reading it; " + advice);
  return std::make_unique<DnnColorizer>(name, files, network());
}

}  // namespace

std::unique_ptr<Colorizer> make_onnx_colorizer(const ColorizerRequest& request) {
  const fs::path file = find_spec_file(request.argument, request);
  const std::string name = "onnx:" + request.argument, advice = "export it with opset 11 to 13 and fixed kernel shapes";
  return read_network(request, name, {file}, advice, [&] {
    const std::string model = read_text_file(file), fault = fault_of_onnx(model);
    if (!fault.empty()) throw ColorizerError(name + ": cannot be read: " + fault + "; " + advice);
    return cv::dnn::readNetFromONNX(model.data(), model.size());
  });
}

std::unique_ptr<Colorizer> make_caffe_colorizer(const ColorizerRequest& request) {
  const std::string& argument = request.argument;
  const auto comma = argument.find(',');
  if (comma == std::string::npos)
    throw UsageError("colorizer \"" + request.options.spec + "\": expected caffe:PROTO,MODEL");
  const fs::path description = find_spec_file(argument.substr(0, comma), request);
  const fs::path weights = find_spec_file(argument.substr(comma + 1), request);
  return read_network(request, "caffe:" + argument, {description, weights},
                      "expected a text description and its binary weights, in this order",
                      [&] { return cv::dnn::readNetFromCaffe(description.string(), weights.string()); });
}

}  // namespace cnerf
