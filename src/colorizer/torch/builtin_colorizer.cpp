// The colorizer that needs no download: a small network whose weights come with the program.

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <future>
#include <numeric>
#include <optional>
#include <span>
#include <vector>

#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/base/rng.h"
#include "src/base/worker.h"
#include "src/colorizer/kinds.h"
#include "src/colorizer/torch/network_weights.h"
#include "src/colorizer/torch/products.h"
#include "src/colorizer/torch/torch_threads.h"
#include "src/colorizer/weights_content.h"

namespace cnerf {
namespace fs = std::filesystem;
using torch::Tensor;

namespace {

// Patches per pass on a GPU. There are few sizes, since cuDNN makes a plan for each, which takes longer than a pass.
constexpr std::array<std::size_t, 3> kPasses = {4, 8, 16};
constexpr int kWarmUpSide = 64;  // pixels

/// One way to show the network a picture. What it says of a place changes with the way, where it does not know: the
/// mean of several ways keeps what they agree on, and is near neutral elsewhere.
struct Way {
  std::size_t side;  ///< of kSides
  bool is_mirrored;
};
constexpr std::array<double, 4> kSides = {0.75, 0.875, 1, 1.25};  // times the side that suits the network best
constexpr std::size_t kWays = 2 * kSides.size();

Way way_of(std::size_t number) {
  return {number / 2, number % 2 == 1};
}

/// Numbers of the ways in which a picture is shown. A field averages answers about every place anyway, so a question of
/// stage 2 is asked in one way, which depends on its number.
std::vector<std::size_t> ways_of(const LightnessBatch& patches, std::size_t picture) {
  if (!patches.origins.empty()) {
    return {CounterRng(named_stream("way"), patches.origins[picture].query).below(0, kWays)};
  }
  std::vector<std::size_t> all(kWays);
  std::iota(all.begin(), all.end(), std::size_t(0));
  return all;
}

/// A picture in one way.
struct Showing {
  std::size_t picture;
  bool is_mirrored;
};

/// Adds rows of so many values, each from behind if they are mirrored.
void add_rows(std::span<const float> from, int width, bool is_mirrored, float factor, float* to) {
  for (std::size_t row = 0; row < from.size(); row += std::size_t(width)) {
    for (std::size_t x = 0; x < std::size_t(width); ++x) {
      to[row + x] += factor * from[row + (is_mirrored ? std::size_t(width) - 1 - x : x)];
    }
  }
}

/// All 0, to which answers are added.
ChromaBatch zero_answer(const LightnessBatch& patches) {
  ChromaBatch answer{patches.batch, patches.height, patches.width, {}, {}};
  answer.ab.resize(2 * patches.lightness.size());
  answer.certainty.resize(patches.lightness.size());
  return answer;
}

/// Runs on CUDA where LibTorch has it, else on the CPU. The same question gets the same answer.
class BuiltinColorizer final : public Colorizer {
 public:
  explicit BuiltinColorizer(const fs::path& file)
      : weights_(load_colorizer_weights(file)), name_("builtin:" + weights_.sha256.substr(0, 12)) {
    weights_.network->to(device_);
    for (Tensor& parameter : weights_.network->parameters()) parameter.set_requires_grad(false);
    if (device_.is_cpu()) {
      prepare_for_answers(*weights_.network);
    } else {
      thread_.emplace();
      warming_up_ = thread_->submit([this] { warm_up(); });
    }
  }

  ChromaBatch colorize(const LightnessBatch& patches) override {
    if (patches.batch < 0 || patches.height < 1 || patches.width < 1) {
      throw ColorizerError(name_ + ": an empty patch cannot be coloured");
    }
    ChromaBatch answer = zero_answer(patches);
    std::vector<std::size_t> all(static_cast<std::size_t>(patches.batch));
    std::iota(all.begin(), all.end(), std::size_t(0));
    if (device_.is_cpu() && patches.batch > 1) {
      // A task a patch: threads that share an operator spend more time on meeting than on work of this size.
      const SingleThreadedOps single;
      parallel_tasks(all.size(), [&](std::size_t i) {
        at::init_num_threads();
        add_answers(patches, std::span(all).subspan(i, 1), answer);
      });
    } else if (device_.is_cpu()) {
      add_answers(patches, all, answer);
    } else {
      is_asked_ = true;
      thread_->submit([&] { add_answers(patches, all, answer); }).get();
    }
    return answer;
  }

  [[nodiscard]] std::string name() const override { return name_; }

 private:
  /// Passes of the sizes that stage 2 asks for, as long as nobody asks: a GPU's first ones take a second, in which
  /// stage 1 trains.
  void warm_up() {
    for (const std::size_t rows : kPasses) {
      for (std::size_t side = 0; side < kSides.size() && !is_asked_; ++side) {
        const LightnessBatch patch{1, kWarmUpSide, kWarmUpSide, std::vector<float>(kWarmUpSide * kWarmUpSide),
                                   std::vector<PatchOrigin>(1)};
        ChromaBatch answer = zero_answer(patch);
        const Showing shown{0, false};
        add_pass(patch, {&shown, 1}, side, rows, answer);
      }
    }
  }

  /// Pictures that are shown at the same size share a pass.
  void add_answers(const LightnessBatch& patches, std::span<const std::size_t> pictures, ChromaBatch& answer) {
    std::array<std::vector<Showing>, kSides.size()> shown;
    for (const std::size_t picture : pictures) {
      for (const std::size_t number : ways_of(patches, picture)) {
        const Way way = way_of(number);
        shown[way.side].push_back({picture, way.is_mirrored});
      }
    }
    for (std::size_t side = 0; side < shown.size(); ++side) {
      const std::span<const Showing> all = shown[side];
      for (std::size_t first = 0; first < all.size();) {
        const std::size_t left = all.size() - first, rows = rows_of_pass(patches, left);
        add_pass(patches, all.subspan(first, std::min(rows, left)), side, rows, answer);
        first += rows;
      }
    }
  }

  /// Whole pictures are shown alone: several would need several times the memory.
  [[nodiscard]] std::size_t rows_of_pass(const LightnessBatch& patches, std::size_t left) const {
    if (device_.is_cpu() || patches.origins.empty()) return 1;
    const auto fits = std::ranges::find_if(kPasses, [left](std::size_t rows) { return rows >= left; });
    return fits == kPasses.end() ? kPasses.back() : *fits;
  }

  /// @param rows  of the pass: those behind the pictures stay black
  void add_pass(const LightnessBatch& patches, std::span<const Showing> shown, std::size_t side, std::size_t rows,
                ChromaBatch& answer) {
    const torch::NoGradGuard no_grad;
    const std::size_t pixels = std::size_t(patches.height) * std::size_t(patches.width);
    Tensor lightness = torch::zeros({std::int64_t(rows), 1, patches.height, patches.width});
    for (std::size_t i = 0; i < shown.size(); ++i) {
      add_rows({&patches.lightness[shown[i].picture * pixels], pixels}, patches.width, shown[i].is_mirrored, 1,
               lightness.data_ptr<float>() + i * pixels);
    }
    const bool is_one_of_many = !patches.origins.empty();
    AbDecoding decoding = weights_.decoding;
    decoding.short_side = int(std::lround(kSides[side] * decoding.short_side));
    if (is_one_of_many) decoding.gain = 1;  // the gain is for a picture that nobody averages with others
    const Tensor asked = lightness.to(device_);
    const Tensor logits = ask_network(weights_.network, asked, decoding.short_side);
    const Tensor cells = torch::cat({decode_ab(logits, decoding), certainty_map(logits)}, 1);
    const Tensor all = guided_upsample(cells, asked).cpu().contiguous();
    const float share = is_one_of_many ? 1 : 1 / float(kWays);
    for (std::size_t i = 0; i < shown.size(); ++i) {
      const float* planes = all.data_ptr<float>() + 3 * i * pixels;
      const auto add = [&](std::size_t first, std::size_t count, std::vector<float>& to) {
        add_rows({planes + first * pixels, count * pixels}, patches.width, shown[i].is_mirrored, share,
                 &to[count * shown[i].picture * pixels]);
      };
      add(0, 2, answer.ab);
      add(2, 1, answer.certainty);
    }
  }

  ColorizerWeights weights_;
  std::string name_;
  torch::Device device_ = torch::cuda::is_available() ? torch::kCUDA : torch::kCPU;
  std::atomic<bool> is_asked_ = false;
  std::future<void> warming_up_;  // whose failure nobody needs to know: the question fails as well
  std::optional<Worker> thread_;  // of all passes on a GPU; last: its jobs refer to what is above
};

}  // namespace

fs::path builtin_weights_file() {
  std::string looked;
  for (const fs::path& place : builtin_weights_places()) {
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
