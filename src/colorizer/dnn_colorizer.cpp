// onnx:FILE and caffe:PROTO,MODEL through OpenCV's dnn module; docs/colorizers.md describes FILE.toml.

#include <opencv2/core/utils/logger.hpp>
#include <opencv2/dnn.hpp>

#include "src/base/error.h"
#include "src/colorizer/kinds.h"
#include "src/colorizer/network_contract.h"

namespace cnerf {
namespace {

namespace fs = std::filesystem;

class DnnColorizer final : public NetworkColorizer {
 public:
  DnnColorizer(std::string name, NetworkContract contract, const cv::dnn::Net& network)
      : NetworkColorizer(std::move(name), std::move(contract)), network_(network) {
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
    } catch (const cv::Exception& error) {
      throw ColorizerError(name_ + ": failed on an input of " + input.shape_text() + ": " + first_line(error.err));
    }
    if (answer.dims != 4 || answer.type() != CV_32F) {
      throw ColorizerError(name_ + ": expected four dimensions, [B, C, H, W], got " + std::to_string(answer.dims));
    }
    const auto* values = answer.ptr<float>();
    return {answer.size[0], answer.size[1], answer.size[2], answer.size[3], {values, values + answer.total()}};
  }

  cv::dnn::Net network_;
};

/// @param advice  what helps most users whose file is refused
template <typename Read>
std::unique_ptr<Colorizer> read_network(const std::string& name, const fs::path& file, const std::string& advice,
                                        const Read& read) {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);  // its errors are told as ours, once
  try {
    return std::make_unique<DnnColorizer>(name, contract_beside(file), read());
  } catch (const cv::Exception& error) {
    throw ColorizerError(name + ": OpenCV " CV_VERSION " cannot read it, or it is cut short: " + first_line(error.err) +
                         "; " + advice);
  }
}

}  // namespace

std::unique_ptr<Colorizer> make_onnx_colorizer(const ColorizerRequest& request) {
  const fs::path file = find_spec_file(request.argument, request);
  return read_network("onnx:" + request.argument, file, "export it with opset 11 to 13 and fixed kernel shapes",
                      [&] { return cv::dnn::readNetFromONNX(file.string()); });
}

std::unique_ptr<Colorizer> make_caffe_colorizer(const ColorizerRequest& request) {
  const std::string& argument = request.argument;
  const auto comma = argument.find(',');
  if (comma == std::string::npos)
    throw UsageError("colorizer \"" + request.options.spec + "\": expected caffe:PROTO,MODEL");
  const fs::path description = find_spec_file(argument.substr(0, comma), request);
  const fs::path weights = find_spec_file(argument.substr(comma + 1), request);
  return read_network("caffe:" + argument, weights, "expected a text description and its binary weights, in this order",
                      [&] { return cv::dnn::readNetFromCaffe(description.string(), weights.string()); });
}

}  // namespace cnerf
