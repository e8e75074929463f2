#include "src/evaluate/lpips.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/dnn.hpp>
#include <vector>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/tensor_file.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

using cv::dnn::LayerParams;

// Of LPIPS's scaling layer; inputs are in [-1, 1].
constexpr float kShift[3] = {-0.030f, -0.088f, -0.188f}, kScale[3] = {0.458f, 0.448f, 0.450f};
constexpr float kTiny = 1e-10f;  // added to norms

/// What OpenCV wants: a matrix of its own.
cv::Mat matrix(const TensorFile::Tensor& tensor) {
  cv::Mat values(tensor.shape, CV_32F);
  std::memcpy(values.data, tensor.values.data(), tensor.values.size_bytes());
  return values;
}

/// A network put together layer by layer.
class Builder {
 public:
  explicit Builder(const TensorFile& tensors) : tensors_(tensors) {}

  /// @param weights  tensor prefix: "conv1", "core.net.slice1.0"
  int convolution(int input, const std::string& weights, int stride, int padding) {
    const cv::Mat kernel = matrix(tensors_.get(weights + ".weight"));
    if (kernel.dims != 4) throw ContractError(weights + ": expected a kernel of four dimensions");
    LayerParams params;
    params.set("num_output", kernel.size[0]);
    params.set("kernel_h", kernel.size[2]);
    params.set("kernel_w", kernel.size[3]);
    params.set("stride", stride);
    params.set("pad", padding);
    cv::Mat bias = matrix(tensors_.get(weights + ".bias"));
    params.blobs = {kernel, bias.reshape(1, 1)};
    return relu(add(weights, "Convolution", params, {input}), weights + ".relu");
  }
  int max_pool(int input, const std::string& name, bool rounds_up) {
    LayerParams params;
    params.set("pool", "max");
    params.set("kernel_size", 3);
    params.set("stride", 2);
    params.set("ceil_mode", rounds_up);
    return add(name, "Pooling", params, {input});
  }
  /// A Fire module: squeeze to few channels, expand by 1x1 and 3x3 kernels side by side.
  int fire(int input, const std::string& weights) {
    const int squeezed = convolution(input, weights + ".squeeze", 1, 0);
    const int small = convolution(squeezed, weights + ".expand1x1", 1, 0);
    const int large = convolution(squeezed, weights + ".expand3x3", 1, 1);
    LayerParams params;
    params.set("axis", 1);
    return add(weights + ".concat", "Concat", params, {small, large});
  }
  /// Features of this layer are compared, with the weights of that tensor.
  void compare(int layer, const std::string& weights) {
    // A copy of its own: outputs that the network asks for are then never computed in place by the next layer.
    outputs.push_back(names_.at(std::size_t(layer)));
    cv::Mat values = matrix(tensors_.get(weights));
    layer_weights.push_back(values.reshape(1, 1).clone());
  }

  cv::dnn::Net net;
  std::vector<std::string> outputs;
  std::vector<cv::Mat> layer_weights;  ///< [1, C] each

 private:
  int relu(int input, const std::string& name) { return add(name, "ReLU", {}, {input}); }

  int add(const std::string& name, const char* type, LayerParams params, const std::vector<int>& inputs) {
    std::string plain = name;
    std::ranges::replace(plain, '.', '_');
    const int layer = net.addLayer(plain, type, params);
    for (std::size_t i = 0; i < inputs.size(); ++i) net.connect(inputs[i], 0, layer, int(i));
    names_.resize(std::size_t(layer) + 1);
    names_[std::size_t(layer)] = plain;
    return layer;
  }

  const TensorFile& tensors_;
  std::vector<std::string> names_;
};

void build_alex(Builder& b) {
  int at = b.convolution(0, "conv1", 4, 2);
  b.compare(at, "lin0.weight");
  at = b.convolution(b.max_pool(at, "pool1", false), "conv2", 1, 2);
  b.compare(at, "lin1.weight");
  at = b.convolution(b.max_pool(at, "pool2", false), "conv3", 1, 1);
  b.compare(at, "lin2.weight");
  at = b.convolution(at, "conv4", 1, 1);
  b.compare(at, "lin3.weight");
  at = b.convolution(at, "conv5", 1, 1);
  b.compare(at, "lin4.weight");
}

void build_squeeze(Builder& b) {
  const auto compare = [&](int layer, int index) {
    b.compare(layer, "core.lins." + std::to_string(index) + ".model.1.weight");
  };
  const auto fire = [&](int input, int slice, int number) {
    return b.fire(input, "core.net.slice" + std::to_string(slice) + "." + std::to_string(number));
  };
  int at = b.convolution(0, "core.net.slice1.0", 2, 0);
  compare(at, 0);
  at = fire(fire(b.max_pool(at, "pool1", true), 2, 3), 2, 4);
  compare(at, 1);
  at = fire(fire(b.max_pool(at, "pool2", true), 3, 6), 3, 7);
  compare(at, 2);
  at = fire(b.max_pool(at, "pool3", true), 4, 9);
  compare(at, 3);
  for (int slice = 5; slice <= 7; ++slice) {
    at = fire(at, slice, slice + 5);
    compare(at, slice - 1);
  }
}

/// [1, 3, H, W], as the networks want it.
cv::Mat network_input(std::span<const std::uint8_t> rgb, int width, int height) {
  cv::Mat input({1, 3, height, width}, CV_32F);
  const std::size_t pixels = std::size_t(width) * std::size_t(height);
  auto* to = input.ptr<float>();
  for (std::size_t i = 0; i < pixels; ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      to[c * pixels + i] = (float(rgb[3 * i + c]) / 127.5f - 1.0f - kShift[c]) / kScale[c];
    }
  }
  return input;
}

/// Mean over places of sum_c w_c (x_c / |x| - y_c / |y|)^2 of [1, C, H, W] features.
double layer_distance(const cv::Mat& x, const cv::Mat& y, const cv::Mat& weights) {
  const auto channels = std::size_t(x.size[1]), places = std::size_t(x.size[2]) * std::size_t(x.size[3]);
  CNERF_CHECK_EQ(channels, weights.total());
  const auto *px = x.ptr<float>(), *py = y.ptr<float>(), *w = weights.ptr<float>();
  std::vector<double> norm_x(places), norm_y(places);
  for (std::size_t c = 0; c < channels; ++c) {
    for (std::size_t i = 0; i < places; ++i) {
      norm_x[i] += double(px[c * places + i]) * px[c * places + i];
      norm_y[i] += double(py[c * places + i]) * py[c * places + i];
    }
  }
  for (std::vector<double>* norms : {&norm_x, &norm_y}) {
    for (double& norm : *norms) norm = std::sqrt(norm) + kTiny;
  }
  double sum = 0;
  for (std::size_t c = 0; c < channels; ++c) {
    for (std::size_t i = 0; i < places; ++i) {
      const double difference = px[c * places + i] / norm_x[i] - py[c * places + i] / norm_y[i];
      sum += double(w[c]) * difference * difference;
    }
  }
  return sum / double(places);
}

}  // namespace

struct Lpips::Network {
  std::string name;
  cv::dnn::Net net;
  std::vector<std::string> outputs;
  std::vector<cv::Mat> layer_weights;

  [[nodiscard]] std::vector<cv::Mat> features(std::span<const std::uint8_t> rgb, int width, int height) {
    net.setInput(network_input(rgb, width, height));
    std::vector<cv::Mat> found;
    net.forward(found, outputs);
    for (cv::Mat& one : found) one = one.clone();  // the next forward pass reuses the memory
    return found;
  }
};

Lpips::Lpips(const fs::path& weights) : network_(std::make_unique<Network>()) {
  const TensorFile tensors(weights);
  Builder builder(tensors);
  const bool is_alex = tensors.has("conv1.weight");
  is_alex ? build_alex(builder) : build_squeeze(builder);
  builder.net.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
  builder.net.enableFusion(false);  // fused layers have no output of their own
  *network_ = {is_alex ? "AlexNet" : "SqueezeNet", builder.net, builder.outputs, builder.layer_weights};
}

Lpips::~Lpips() = default;

const std::string& Lpips::network() const {
  return network_->name;
}

double Lpips::distance(std::span<const std::uint8_t> ours, std::span<const std::uint8_t> truth, int width,
                       int height) const {
  const std::size_t values = 3 * std::size_t(width) * std::size_t(height);
  CNERF_CHECK_EQ(ours.size(), values);
  CNERF_CHECK_EQ(truth.size(), values);
  CNERF_CHECK(std::min(width, height) >= kLeastSide, "pictures of at least 32 x 32 pixels");
  const std::vector<cv::Mat> x = network_->features(ours, width, height);
  const std::vector<cv::Mat> y = network_->features(truth, width, height);
  double sum = 0;
  for (std::size_t layer = 0; layer < x.size(); ++layer) {
    sum += layer_distance(x[layer], y[layer], network_->layer_weights[layer]);
  }
  return sum;
}

}  // namespace cnerf
