// The colorizer that needs no download: a small network whose weights come with the program.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <numeric>
#include <span>
#include <vector>

#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/base/plugin.h"
#include "src/base/rng.h"
#include "src/colorizer/kinds.h"
#include "src/colorizer/torch/network_weights.h"
#include "src/colorizer/torch/products.h"
#include "src/colorizer/torch/torch_threads.h"

namespace cnerf {
namespace fs = std::filesystem;
using torch::Tensor;

namespace {

constexpr const char* kWeightsName = "colorizer.weights";
constexpr std::size_t kPatchesPerPass = 8;  // on a GPU

/// One way to show the network a picture. What it says of a place changes with the way, where it does not know: the
/// mean of several ways keeps what they agree on, and is near neutral elsewhere.
struct Way {
  double side;  ///< times the side that suits the network best
  bool is_mirrored;
};
constexpr std::array<Way, 8> kWays = {
    {{0.75, false}, {0.75, true}, {0.875, false}, {0.875, true}, {1, false}, {1, true}, {1.25, false}, {1.25, true}}};

/// Numbers of the ways in which a picture is shown. A field averages answers about every place anyway, so a question of
/// stage 2 is asked in one way, which depends on its number.
std::vector<std::size_t> ways_of(const LightnessBatch& patches, std::size_t picture) {
  if (!patches.origins.empty()) {
    return {CounterRng(named_stream("way"), patches.origins[picture].query).below(0, kWays.size())};
  }
  std::vector<std::size_t> all(kWays.size());
  std::iota(all.begin(), all.end(), std::size_t(0));
  return all;
}

/// Runs on CUDA where LibTorch has it, else on the CPU. The same question gets the same answer.
class BuiltinColorizer final : public Colorizer {
 public:
  explicit BuiltinColorizer(const fs::path& file)
      : weights_(load_colorizer_weights(file)), name_("builtin:" + weights_.sha256.substr(0, 12)) {
    weights_.network->to(device_);
    for (Tensor& parameter : weights_.network->parameters()) parameter.set_requires_grad(false);
    if (device_.is_cpu()) prepare_for_answers(*weights_.network);
  }

  ChromaBatch colorize(const LightnessBatch& patches) override {
    if (patches.batch < 0 || patches.height < 1 || patches.width < 1) {
      throw ColorizerError(name_ + ": an empty patch cannot be coloured");
    }
    ChromaBatch answer{patches.batch, patches.height, patches.width, {}, {}};
    answer.ab.resize(2 * patches.lightness.size());
    std::vector<std::size_t> all(static_cast<std::size_t>(patches.batch));
    std::iota(all.begin(), all.end(), std::size_t(0));
    if (device_.is_cpu() && patches.batch > 1) {
      // A task a patch: threads that share an operator spend more time on meeting than on work of this size.
      const SingleThreadedOps single;
      parallel_tasks(all.size(), [&](std::size_t i) {
        at::init_num_threads();
        add_answers(patches, std::span(all).subspan(i, 1), answer);
      });
    } else {
      add_answers(patches, all, answer);
    }
    return answer;
  }

  [[nodiscard]] std::string name() const override { return name_; }

 private:
  /// Pictures that are shown in the same way share a pass.
  void add_answers(const LightnessBatch& patches, std::span<const std::size_t> pictures, ChromaBatch& answer) {
    std::array<std::vector<std::size_t>, kWays.size()> shown;
    for (const std::size_t picture : pictures) {
      for (const std::size_t way : ways_of(patches, picture)) shown[way].push_back(picture);
    }
    for (std::size_t way = 0; way < shown.size(); ++way) {
      for (std::size_t first = 0; first < shown[way].size(); first += kPatchesPerPass) {
        const std::size_t count = std::min(kPatchesPerPass, shown[way].size() - first);
        add_pass(patches, std::span(shown[way]).subspan(first, count), kWays[way], answer);
      }
    }
  }

  void add_pass(const LightnessBatch& patches, std::span<const std::size_t> pictures, const Way& way,
                ChromaBatch& answer) {
    const torch::NoGradGuard no_grad;
    const std::size_t pixels = std::size_t(patches.height) * std::size_t(patches.width);
    Tensor lightness = torch::empty({std::int64_t(pictures.size()), 1, patches.height, patches.width});
    for (std::size_t i = 0; i < pictures.size(); ++i) {
      std::copy_n(&patches.lightness[pictures[i] * pixels], pixels, lightness.data_ptr<float>() + i * pixels);
    }
    if (way.is_mirrored) lightness = lightness.flip({3});
    const bool is_one_of_many = !patches.origins.empty();
    AbDecoding decoding = weights_.decoding;
    decoding.short_side = int(std::lround(way.side * decoding.short_side));
    if (is_one_of_many) decoding.gain = 1;  // the gain is for a picture that nobody averages with others
    Tensor ab = colorize_lightness(weights_.network, lightness.to(device_), decoding).cpu();
    if (way.is_mirrored) ab = ab.flip({3});
    ab = (ab / double(is_one_of_many ? 1 : kWays.size())).contiguous();
    for (std::size_t i = 0; i < pictures.size(); ++i) {
      const float* from = ab.data_ptr<float>() + 2 * i * pixels;
      float* to = &answer.ab[2 * pictures[i] * pixels];
      std::transform(from, from + 2 * pixels, to, to, std::plus<>());
    }
  }

  ColorizerWeights weights_;
  std::string name_;
  torch::Device device_ = torch::cuda::is_available() ? torch::kCUDA : torch::kCPU;
};

std::vector<fs::path> candidate_weights() {
  std::vector<fs::path> places = data_places(kWeightsName);
  if (const char* named = std::getenv("CNERF_COLORIZER_WEIGHTS")) places.insert(places.begin(), named);
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
