#pragma once
/// The nets of the paper's own field as LibTorch modules, and their optimiser.

#include <torch/torch.h>

#include <span>
#include <string>
#include <vector>

#include "src/color/ab_bins.h"
#include "src/compare/baselines/positional_field.h"
#include "src/compare/baselines/torch/positional_math.h"
#include "src/engine/engines.h"

namespace cnerf::compare {

inline constexpr int kTrunkWidth = 256, kTrunkLayers = 8, kSkipBehind = 4, kHeadWidth = 128;
inline constexpr std::int64_t kEncodedPosition = 3 * (1 + 2 * kPositionFrequencies);
inline constexpr std::int64_t kEncodedDirection = 3 * (1 + 2 * kDirectionFrequencies);
inline constexpr std::int64_t kPointsAtATime = 1 << 17;  ///< bounds the memory of activations without gradients

/// CUDA where LibTorch has it.
[[nodiscard]] inline torch::Device torch_device() {
  return torch::cuda::is_available() ? torch::kCUDA : torch::kCPU;
}

/// While it lives, GPUs multiply matrices in TF32: the MLP is to be as fast as it can.
class FastProducts {
 public:
  FastProducts() { at::globalContext().setAllowTF32CuBLAS(true); }
  ~FastProducts() { at::globalContext().setAllowTF32CuBLAS(before_); }
  FastProducts(const FastProducts&) = delete;
  FastProducts& operator=(const FastProducts&) = delete;

 private:
  bool before_ = at::globalContext().allowTF32CuBLAS();
};

/// A copy on the device.
template <typename Value>
torch::Tensor tensor_of(const std::vector<Value>& values, torch::IntArrayRef shape, torch::Dtype type) {
  return torch::from_blob(const_cast<Value*>(values.data()), shape, type).clone().to(torch_device());
}
[[nodiscard]] std::vector<float> floats_of(const torch::Tensor& values);

/// The same numbers on every device.
[[nodiscard]] torch::Tensor uniform(std::uint64_t seed, std::uint64_t stream, torch::IntArrayRef shape);
/// Uniform in +-1 / sqrt(inputs), LibTorch's own bounds of a linear layer, but of our seed.
void initialise(torch::nn::Module& module, std::uint64_t seed);
/// `a` followed by `b`.
[[nodiscard]] std::vector<torch::Tensor> joined(std::vector<torch::Tensor> a, const std::vector<torch::Tensor>& b);

/// Eight layers of 256; the encoded position joins again behind the fifth.
struct TrunkImpl : torch::nn::Module {
  TrunkImpl() {
    for (int l = 0; l < kTrunkLayers; ++l) {
      const std::int64_t joined = l == kSkipBehind + 1 ? kEncodedPosition : 0;
      layers->push_back(torch::nn::Linear(l == 0 ? kEncodedPosition : kTrunkWidth + joined, kTrunkWidth));
    }
    register_module("layers", layers);
  }
  /// @param positions  [N, 3], unit space  @return  w, [N, 256]
  torch::Tensor forward(const torch::Tensor& positions) {
    const torch::Tensor encoded = positional::encoding(2 * positions - 1, kPositionFrequencies);
    torch::Tensor x = encoded;
    for (int l = 0; l < kTrunkLayers; ++l) {
      x = torch::relu(layers->at<torch::nn::LinearImpl>(std::size_t(l)).forward(x));
      if (l == kSkipBehind) x = torch::cat({x, encoded}, 1);
    }
    return x;
  }
  torch::nn::ModuleList layers;
};
TORCH_MODULE(Trunk);

/// Density and luminance of points.
struct LuminanceNetImpl : torch::nn::Module {
  LuminanceNetImpl() {
    register_module("trunk", trunk);
    register_module("density", density);
    register_module("feature", feature);
    register_module("first", first);
    register_module("second", second);
    register_module("luminance", luminance);
  }
  struct Raw {
    torch::Tensor density, luminance;  // [N]
  };
  Raw forward(const torch::Tensor& positions, const torch::Tensor& directions) {
    const torch::Tensor w = trunk->forward(positions);
    const torch::Tensor seen = positional::encoding(directions, kDirectionFrequencies);
    torch::Tensor x = torch::relu(first->forward(torch::cat({feature->forward(w), seen}, 1)));
    x = torch::relu(second->forward(x));
    return {density->forward(w).squeeze(1), luminance->forward(x).squeeze(1)};
  }
  torch::Tensor raw_density(const torch::Tensor& positions) {
    return density->forward(trunk->forward(positions)).squeeze(1);
  }

  Trunk trunk;
  torch::nn::Linear density{kTrunkWidth, 1}, feature{kTrunkWidth, kTrunkWidth};
  torch::nn::Linear first{kTrunkWidth + kEncodedDirection, kHeadWidth}, second{kHeadWidth, kHeadWidth};
  torch::nn::Linear luminance{kHeadWidth, 1};
};
TORCH_MODULE(LuminanceNet);

/// Theta_Z up to its last layer, which is linear and so comes after compositing, once per pixel.
struct ChromaNetImpl : torch::nn::Module {
  ChromaNetImpl() {
    register_module("first", first);
    register_module("second", second);
    register_module("classes", classes);
  }
  torch::Tensor hidden(const torch::Tensor& w) { return torch::relu(second->forward(torch::relu(first->forward(w)))); }
  torch::nn::Linear first{kTrunkWidth, kHeadWidth}, second{kHeadWidth, kHeadWidth}, classes{kHeadWidth, kAbBinCount};
};
TORCH_MODULE(ChromaNet);

/// Parameters of some modules with Adam's moments (Kingma and Ba 2015), each as one vector that snapshots hold.
class Trained {
 public:
  explicit Trained(const std::vector<torch::Tensor>& parameters);

  /// Follows the gradients and forgets them.  @param step  1 for the first
  void follow(double learning_rate, std::int64_t step);

  void append_state(const std::string& prefix, std::vector<StatePiece>& state);
  void state_loaded();

 private:
  std::vector<torch::Tensor> parameters_;
  torch::Tensor values_, mean_, square_;
  std::vector<torch::Tensor> host_;  // on the processor, of the same memory as those or a copy
};

/// A luminance engine of this field, and its w.
struct PositionalLuminance {
  std::unique_ptr<LuminanceEngine> engine;
  Trunk encoding;
};
[[nodiscard]] PositionalLuminance make_positional_luminance(const LuminanceEngineOptions& options,
                                                            const PositionalRays& rays);
/// A colour engine of this field.
/// @param encoding  w, of which it holds a copy; empty = random
[[nodiscard]] std::unique_ptr<ColorBinEngine> make_positional_color_bins(std::uint64_t seed, Trunk encoding);

}  // namespace cnerf::compare
