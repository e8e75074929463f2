// The colorizer that needs no download: a small network whose weights come with the program.

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/colorizer/kinds.h"
#include "src/colorizer/torch/network_weights.h"
#include "src/colorizer/torch/single_threaded_ops.h"

namespace cnerf {
namespace fs = std::filesystem;
using torch::Tensor;

namespace {

constexpr const char* kWeightsName = "colorizer.weights";
constexpr int kPatchesPerPass = 8;  // on a GPU

/// A batch of 8 patches of 128x128 is one pass; larger batches are split. Runs on CUDA where LibTorch has it, else on
/// the CPU. Answers ab by the decoding stored with the weights; the same input gives the same answer.
class BuiltinColorizer final : public Colorizer {
 public:
  explicit BuiltinColorizer(const fs::path& file)
      : weights_(load_colorizer_weights(file)), name_("builtin:" + weights_.sha256.substr(0, 12)) {
    weights_.network->to(device_);
    for (Tensor& parameter : weights_.network->parameters()) parameter.set_requires_grad(false);
  }

  ChromaBatch colorize(const LightnessBatch& patches) override {
    if (patches.batch < 0 || patches.height < 1 || patches.width < 1) {
      throw ColorizerError(name_ + ": an empty patch cannot be coloured");
    }
    ChromaBatch answer{patches.batch, patches.height, patches.width, {}, {}};
    answer.ab.resize(2 * patches.lightness.size());
    if (device_.is_cpu() && patches.batch > 1) {
      // A task a patch: threads that share an operator spend more time on meeting than on work of this size.
      const SingleThreadedOps single;
      parallel_tasks(std::size_t(patches.batch), [&](std::size_t i) {
        at::init_num_threads();
        colorize_pass(patches, int(i), 1, answer);
      });
      return answer;
    }
    for (int first = 0; first < patches.batch; first += kPatchesPerPass) {
      colorize_pass(patches, first, std::min(kPatchesPerPass, patches.batch - first), answer);
    }
    return answer;
  }

  [[nodiscard]] std::string name() const override { return name_; }

 private:
  void colorize_pass(const LightnessBatch& patches, int first, int count, ChromaBatch& answer) {
    const torch::NoGradGuard no_grad;
    const std::size_t pixels = std::size_t(patches.height) * std::size_t(patches.width);
    Tensor lightness = torch::empty({count, 1, patches.height, patches.width});
    std::memcpy(lightness.data_ptr<float>(), &patches.lightness[std::size_t(first) * pixels], lightness.nbytes());
    const Tensor ab = colorize_lightness(weights_.network, lightness.to(device_), weights_.decoding).cpu().contiguous();
    std::memcpy(&answer.ab[2 * std::size_t(first) * pixels], ab.data_ptr<float>(), ab.nbytes());
  }

  ColorizerWeights weights_;
  std::string name_;
  torch::Device device_ = torch::cuda::is_available() ? torch::kCUDA : torch::kCPU;
};

std::vector<fs::path> candidate_weights() {
  std::vector<fs::path> places;
  if (const char* named = std::getenv("CNERF_COLORIZER_WEIGHTS")) places.emplace_back(named);
  std::error_code failure;
  const fs::path program = fs::read_symlink("/proc/self/exe", failure);
  if (!failure) places.push_back(program.parent_path().parent_path() / "share" / "cnerf" / kWeightsName);
  places.push_back(fs::path(CNERF_WEIGHTS_FOLDER) / kWeightsName);
  return places;
}

}  // namespace

fs::path builtin_weights_file() {
  const std::vector<fs::path> places = candidate_weights();
  std::string looked;
  for (const fs::path& place : places) {
    if (fs::exists(place)) return place;
    looked += " " + place.string();
  }
  throw MissingInputError("weights of the built-in colorizer not found; looked at" + looked);
}

std::unique_ptr<Colorizer> make_builtin_colorizer(const ColorizerRequest& request) {
  return std::make_unique<BuiltinColorizer>(request.argument.empty() ? builtin_weights_file()
                                                                     : find_spec_file(request.argument, request));
}

}  // namespace cnerf
