#include "src/colorizer/torch/reference_network.h"

#include <torch/torch.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <sstream>
#include <utility>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/parallel.h"
#include "src/color/ab_bins.h"
#include "src/colorizer/torch/encoder.h"
#include "src/colorizer/torch/network_weights.h"
#include "src/colorizer/torch/products.h"
#include "src/colorizer/torch/torch_threads.h"

namespace cnerf {
namespace {

namespace nn = torch::nn;
using torch::Tensor;

constexpr float kAbScale = 40.0f;  // network units of ab: keeps outputs near 1
constexpr double kStageScale = 4;  // of the encoder's features

/// Convolution, SiLU. No normalisation: with it, the same time of fitting ends at colours a tenth further from the
/// truth.
struct BlockImpl : nn::Module {
  BlockImpl(int in, int out, int stride, int dilation = 1)
      : conv(register_module(
            "conv", nn::Conv2d(nn::Conv2dOptions(in, out, 3).stride(stride).padding(dilation).dilation(dilation)))) {}
  Tensor forward(const Tensor& x) { return torch::silu(conv(x)); }

  nn::Conv2d conv;
};
TORCH_MODULE(Block);

/// Pixels of [B, C, H, W] with their channels beside each other: [B, H, W, C], and back. Neither copies where channels
/// lie last.
Tensor channels_last(const Tensor& x) {
  return x.permute({0, 2, 3, 1});
}
Tensor channels_first(const Tensor& x) {
  return x.permute({0, 3, 1, 2});
}

/// A 1x1 convolution as one product over all pixels: LibTorch's own would copy its input to rearrange it.
struct PointwiseImpl : nn::Module {
  PointwiseImpl(int in, int out, bool has_bias = true)
      : linear(register_module("linear", nn::Linear(nn::LinearOptions(in, out).bias(has_bias)))) {}
  Tensor forward(const Tensor& x) { return channels_first(linear(channels_last(x))); }

  nn::Linear linear;
};
TORCH_MODULE(Pointwise);

/// What the frozen networks make of a picture; empty without them.
struct Guidance {
  // Levels of the U-Net at the same resolution.
  static constexpr std::size_t kSemanticLevel = 3, kAbLevel = 1, kFirstStageLevel = 1;
  Tensor semantic;             ///< [B, ColorizerNetImpl::kSemanticChannels, H/16, W/16]
  Tensor ab;                   ///< [B, 2, H/4, W/4], network units
  std::vector<Tensor> stages;  ///< of the encoder, as `scaled_stage` makes them
};

/// A stage of the encoder as a 1x1 convolution learns well from it: of like size in every place, and the smaller the
/// more channels there are, since each of them moves as far in a step.
Tensor scaled_stage(const Tensor& stage) {
  const int64_t channels = stage.size(1);
  return channels_first(torch::layer_norm(channels_last(stage), {channels})) *
         (kStageScale / std::sqrt(double(channels)));
}

/// The mean about every pixel of [B, 1, H, W], contiguous, as far as `reach`; edges are repeated.
Tensor box_mean(const Tensor& pictures, int reach) {
  Tensor means = torch::empty_like(pictures);
  const auto height = int(pictures.size(2)), width = int(pictures.size(3)), side = 2 * reach + 1;
  for (int64_t b = 0; b < pictures.size(0); ++b) {
    const cv::Mat picture(height, width, CV_32F, pictures[b].data_ptr<float>());
    cv::Mat mean(height, width, CV_32F, means[b].data_ptr<float>());
    cv::blur(picture, mean, {side, side}, {-1, -1}, cv::BORDER_REPLICATE);
  }
  return means;
}

/// U-Net from lightness at full size to `outputs` channels at half size.
struct UNetImpl : nn::Module {
  UNetImpl(const ReferenceRecipe& recipe, int outputs) {
    const auto& c = recipe.channels;
    int in = 5;  // of features()
    for (std::size_t level = 0; level < c.size(); ++level) {
      down.push_back(register_module("down" + std::to_string(level), Block(in, c[level], 2)));
      encode.push_back(register_module("encode" + std::to_string(level), Block(c[level], c[level], 1)));
      in = c[level];
    }
    wide = register_module("wide", Block(in, in, 1, 2));
    global = register_module("global", Pointwise(in, in));
    for (std::size_t level = c.size() - 1; level-- > 0;) {
      const std::string name = std::to_string(level);
      lateral.push_back(register_module("lateral" + name, Pointwise(c[level + 1], c[level], false)));
      decode.push_back(register_module("decode" + name, Block(c[level], c[level], 1)));
    }
    head = register_module("head", Pointwise(c[0], outputs));
    if (recipe.encoder) read_encoder(recipe);
    if (recipe.builtin.empty()) return;
    CNERF_CHECK(c.size() > Guidance::kSemanticLevel, "as many levels as the built-in network's features need");
    CNERF_CHECK_EQ(recipe.patch_size % ColorizerNetImpl::kInputMultiple, 0);
    guide_semantic =
        register_module("guide_semantic", Pointwise(ColorizerNetImpl::kSemanticChannels, c[Guidance::kSemanticLevel]));
    guide_ab = register_module("guide_ab", nn::Conv2d(nn::Conv2dOptions(2, c[Guidance::kAbLevel], 3).padding(1)));
  }

  /// An adapter for each stage that has a level of its resolution.
  void read_encoder(const ReferenceRecipe& recipe) {
    CNERF_CHECK_EQ(recipe.patch_size % Encoder::kInputMultiple, 0);
    for (std::size_t stage = 0; stage < Encoder::kStages; ++stage) {
      const std::size_t level = stage + Guidance::kFirstStageLevel;
      if (level >= recipe.channels.size()) break;
      guide_stages.push_back(register_module("guide_stage" + std::to_string(stage),
                                             Pointwise(recipe.encoder->channels()[stage], recipe.channels[level])));
    }
  }

  /// @param features  of lightness [B, 1, H, W], H and W multiples of 2^levels.   @return [B, outputs, H/2, W/2] f32
  Tensor forward(const Tensor& features, const Guidance& guidance) {
    Tensor x = features;
    std::vector<Tensor> skips;
    for (std::size_t level = 0; level < down.size(); ++level) {
      x = down[level](x);
      if (guide_semantic && level == Guidance::kSemanticLevel) x = x + guide_semantic(guidance.semantic);
      if (guide_ab && level == Guidance::kAbLevel) x = x + guide_ab(guidance.ab);
      const std::size_t stage = level - Guidance::kFirstStageLevel;  // huge before the first
      if (stage < guide_stages.size()) x = x + guide_stages[stage](guidance.stages[stage]);
      x = x + encode[level](x);
      skips.push_back(x);
    }
    x = x + wide(x);
    x = x + global(x.mean({2, 3}, true));
    for (std::size_t i = 0; i < decode.size(); ++i) {
      const Tensor& skip = skips[skips.size() - 2 - i];
      x = torch::upsample_nearest2d(lateral[i](x), {skip.size(2), skip.size(3)}) + skip;
      x = x + decode[i](x);
    }
    return head(x);
  }

  /// Lightness, what stands out of its surroundings at two scales, and how busy those are: as convolutions read it.
  [[nodiscard]] static Tensor features(const Tensor& lightness) {
    const Tensor level = (lightness - 50) / 50, squares = level * level;
    std::vector<Tensor> all{level};
    for (const int reach : {3, 10}) {
      const Tensor mean = box_mean(level, reach);
      const Tensor deviation = (box_mean(squares, reach) - mean * mean).clamp_min(0).add(1e-4).sqrt();
      all.push_back((level - mean) / (deviation + 0.05));
      all.push_back(deviation.log() * 0.5 + 1);
    }
    return torch::cat(all, 1).contiguous(at::MemoryFormat::ChannelsLast);
  }

  std::vector<Block> down, encode, decode;
  std::vector<Pointwise> lateral;
  Block wide{nullptr};
  Pointwise global{nullptr}, head{nullptr};
  Pointwise guide_semantic{nullptr};  // this and the next are empty without guidance
  nn::Conv2d guide_ab{nullptr};
  std::vector<Pointwise> guide_stages;
};
TORCH_MODULE(UNet);

/// Draws weights without touching LibTorch's global generator: convolutions before a SiLU by He et al. 2015, the others
/// smaller. Biases start at 0.
void initialise(UNet& net, std::uint64_t seed) {
  torch::NoGradGuard no_grad;
  SequentialRng rng(seed, named_stream("init"));
  for (auto& item : net->named_parameters()) {
    Tensor& parameter = item.value();
    if (parameter.dim() < 2) {
      parameter.zero_();
      continue;
    }
    const double fan_in = double(parameter.numel()) / double(parameter.size(0));
    const bool guide = item.key().rfind("guide", 0) == 0;
    const bool last = item.key().rfind("head", 0) == 0, before_silu = item.key().find(".conv.") != std::string::npos;
    const double gain = guide ? 0 : last ? 0.1 : before_silu ? 1.4 : 0.6;
    Tensor values = torch::empty(parameter.sizes());
    float* value = values.data_ptr<float>();
    for (int64_t i = 0; i < values.numel(); ++i) value[i] = float(gain / std::sqrt(fan_in)) * rng.normal();
    parameter.copy_(values);
  }
}

/// The bins that occur in the photographs: the network's classes.
std::vector<int> bins_in(std::span<const ReferenceImage> images) {
  std::vector<std::size_t> count(kAbBinCount, 0);
  std::size_t pixels = 0;
  for (const ReferenceImage& image : images) {
    const LabImage& level = image.counted();
    for (std::size_t i = 0; i < level.lab.size(); i += 3) {
      if (std::isnan(level.lab[i + 1])) continue;
      ++count[std::size_t(nearest_bin({level.lab[i + 1], level.lab[i + 2]}))];
      ++pixels;
    }
  }
  std::vector<int> bins;
  for (int bin = 0; bin < kAbBinCount; ++bin) {
    if (count[std::size_t(bin)] * 20000 > pixels) bins.push_back(bin);
  }
  return bins;
}

/// Soft labels over the classes, looked up by ab rounded to whole units: searching the bins for every pixel of every
/// patch would take a tenth of the fit.
class LabelTable {
 public:
  struct Entry {
    std::array<int64_t, kSoftLabelBins> index{};
    std::array<float, kSoftLabelBins> weight{};  // bins that are no class have none
  };

  explicit LabelTable(const std::vector<int>& class_of) : entries_(std::size_t(kSide) * kSide) {
    for (int a = 0; a < kSide; ++a) {
      for (int b = 0; b < kSide; ++b) {
        const SoftLabel label = soft_label({float(a - kReach), float(b - kReach)});
        Entry& entry = entries_[std::size_t(a) * kSide + std::size_t(b)];
        for (std::size_t k = 0; k < kSoftLabelBins; ++k) {
          const int found = class_of[std::size_t(label.bin[k])];
          entry.index[k] = std::max(found, 0);
          entry.weight[k] = found < 0 ? 0.0f : label.weight[k];
        }
      }
    }
  }
  [[nodiscard]] const Entry& at(float a, float b) const {
    if (std::isnan(a)) return unknown_;
    const auto cell = [](float v) { return std::size_t(std::clamp(int(std::lround(v)) + kReach, 0, kSide - 1)); };
    return entries_[cell(a) * kSide + cell(b)];
  }

 private:
  static constexpr int kReach = 115, kSide = 2 * kReach + 1;
  std::vector<Entry> entries_;
  Entry unknown_;  // weighs nothing
};

}  // namespace

std::string ReferenceRecipe::text() const {
  std::ostringstream text;
  text << "reference network 6; channels";
  for (int c : channels) text << ' ' << c;
  text << "; patch " << patch_size << "; steps " << steps << "; batch " << batch << '/' << shards << "; rate "
       << learning_rate << "; decay " << weight_decay << "; share " << distortion.share_min << ' '
       << distortion.share_max << "; rotation " << distortion.rotation << "; stretch " << distortion.stretch
       << "; flip " << distortion.flip << "; tone " << distortion.log_gamma << ' ' << distortion.contrast << "; blur "
       << distortion.blur << "; noise " << distortion.noise;
  if (!builtin.empty()) text << "; on " << sha256(read_binary_file(builtin));
  if (encoder) text << "; encoder " << encoder->sha256() << ", scale " << kStageScale;
  if (patch_uses > 1) text << "; each patch " << patch_uses << " times of " << patches_held;
  return text.str();
}

/// Part of a batch that is learned from.
struct Patches {
  Tensor features, ab;  ///< [n, 5, H, W], [n, 2, H, W]
  Guidance guidance;

  [[nodiscard]] Patches slice(int64_t begin, int64_t end) const {
    const auto part = [&](const Tensor& all) { return all.defined() ? all.slice(0, begin, end) : all; };
    Patches patches{part(features), part(ab), {part(guidance.semantic), part(guidance.ab), {}}};
    for (const Tensor& stage : guidance.stages) patches.guidance.stages.push_back(part(stage));
    return patches;
  }
};

struct ReferenceNetwork::Parts {
  ReferenceRecipe recipe;
  std::uint64_t seed = 0;
  std::unique_ptr<LabelTable> labels;
  Tensor centres;  // [classes, 2]
  UNet net{nullptr};
  std::optional<ColorizerWeights> builtin;

  [[nodiscard]] Guidance guidance(const Tensor& lightness) const {
    const torch::NoGradGuard no_grad;
    Guidance guidance;
    if (builtin) {
      const ColorizerFeatures features = ColorizerNet(builtin->network)->features(lightness);
      guidance.semantic = features.semantic.to(torch::kFloat32);
      guidance.ab = decode_ab(features.logits, builtin->decoding) / kAbScale;
    }
    if (recipe.encoder) {
      for (const Tensor& stage : recipe.encoder->features(lightness)) {
        guidance.stages.push_back(scaled_stage(stage));
      }
    }
    return guidance;
  }
  [[nodiscard]] Tensor decode(const Tensor& out) const {
    return channels_first(torch::softmax(channels_last(out), -1).matmul(centres));
  }
  /// The mean cross entropy of what the network says of ab, and its gradient by that.
  [[nodiscard]] std::pair<double, Tensor> loss(const Tensor& out, const Tensor& ab) const;
  /// New patches of the photographs, those of `times` draws.
  [[nodiscard]] Patches drawn(std::span<const ReferenceImage> images, int first_draw, int times, int shard) const;
  /// Those of a step, of which `held` are kept from step to step. Some are drawn before their turn: the frozen networks
  /// take half of the time over pictures together.
  [[nodiscard]] const Patches& patches_of(std::span<const ReferenceImage> images, int step, int shard,
                                          std::vector<Patches>& held) const;
  [[nodiscard]] std::vector<Tensor> gradients(const Patches& patches, double* loss) const;
};

std::pair<double, Tensor> ReferenceNetwork::Parts::loss(const Tensor& out, const Tensor& ab) const {
  const torch::NoGradGuard no_grad;
  const Tensor p = torch::softmax(channels_last(out), -1), colors = channels_last(ab).contiguous();
  const int64_t pixels = colors.numel() / 2;
  Tensor index = torch::empty({pixels, kSoftLabelBins}, torch::kInt64);
  Tensor weight = torch::empty({pixels, kSoftLabelBins});
  const float* color = colors.data_ptr<float>();
  for (int64_t i = 0; i < pixels; ++i) {
    const LabelTable::Entry& label = labels->at(color[2 * i], color[2 * i + 1]);
    std::ranges::copy(label.index, index.data_ptr<int64_t>() + i * kSoftLabelBins);
    std::ranges::copy(label.weight, weight.data_ptr<float>() + i * kSoftLabelBins);
  }
  const Tensor by_pixel = p.view({pixels, -1});
  const Tensor log_p = by_pixel.gather(1, index).clamp_min(std::numeric_limits<float>::min()).log();
  const double value = -(log_p * weight).sum().item<double>() / double(pixels);
  weight /= float(pixels);
  by_pixel.mul_(weight.sum(1, /*keepdim=*/true)).scatter_add_(1, index, -weight);
  return {value, channels_first(p)};
}

Patches ReferenceNetwork::Parts::drawn(std::span<const ReferenceImage> images, int first_draw, int times,
                                       int shard) const {
  const int each = recipe.batch / recipe.shards, count = times * each, size = recipe.patch_size;
  const std::size_t pixels = std::size_t(size) * std::size_t(size);
  const Tensor lightness = torch::empty({count, 1, size, size});
  Patches patches{{}, torch::empty({count, 2, size, size}), {}};
  for (int i = 0; i < count; ++i) {
    const int draw = first_draw + i / each, in_draw = shard * each + i % each;
    SequentialRng rng(seed, (std::uint64_t(draw) << 16) + std::uint64_t(in_draw) + 1);
    sample_reference_patch(images, recipe.distortion, size, rng,
                           {lightness.data_ptr<float>() + std::size_t(i) * pixels, pixels},
                           {patches.ab.data_ptr<float>() + std::size_t(i) * 2 * pixels, 2 * pixels});
  }
  patches.features = UNetImpl::features(lightness);
  patches.guidance = guidance(lightness);
  return patches;
}

const Patches& ReferenceNetwork::Parts::patches_of(std::span<const ReferenceImage> images, int step, int shard,
                                                   std::vector<Patches>& held) const {
  constexpr int kMostAtOnce = 4;
  const int at_once = std::min(kMostAtOnce, recipe.patches_held), each = recipe.batch / recipe.shards;
  if (step % (recipe.patch_uses * at_once) == 0) {
    const int first_draw = step / recipe.patch_uses;
    const Patches fresh = drawn(images, first_draw, at_once, shard);
    for (int i = 0; i < at_once; ++i) {
      const auto place = std::size_t((first_draw + i) % recipe.patches_held);
      held.resize(std::max(held.size(), place + 1));
      held[place] = fresh.slice(i * each, (i + 1) * each);
    }
  }
  SequentialRng rng(seed, named_stream("held") + (std::uint64_t(step) << 16) + std::uint64_t(shard));
  return held[std::min(held.size() - 1, std::size_t(rng.uniform(0, float(held.size()))))];
}

std::vector<Tensor> ReferenceNetwork::Parts::gradients(const Patches& patches, double* loss_value) const {
  const Tensor out = UNet(net)->forward(patches.features, patches.guidance);
  const auto [value, by_out] = loss(out, torch::avg_pool2d(patches.ab, {2, 2}));
  *loss_value = value;
  return torch::autograd::grad({out}, net->parameters(), {by_out});
}

void use_builtin(ReferenceRecipe& recipe, const std::filesystem::path& weights) {
  recipe.builtin = weights;
  recipe.patch_uses = 2;
  recipe.patches_held = 16;
}

void use_encoder(ReferenceRecipe& recipe, std::shared_ptr<const Encoder> encoder) {
  recipe.encoder = std::move(encoder);
  recipe.patch_uses = 4;
  recipe.patches_held = 16;
}

ReferenceNetwork::ReferenceNetwork(const ReferenceRecipe& recipe, std::span<const ReferenceImage> images,
                                   std::uint64_t seed)
    : parts_(std::make_unique<Parts>()) {
  CNERF_CHECK_EQ(recipe.batch % recipe.shards, 0);
  parts_->recipe = recipe;
  parts_->seed = seed;
  const std::vector<int> bins = bins_in(images);
  std::vector<int> class_of(kAbBinCount, -1);
  parts_->centres = torch::empty({int64_t(bins.size()), 2});
  for (std::size_t i = 0; i < bins.size(); ++i) {
    const Ab centre = ab_bin_centres()[std::size_t(bins[i])];
    class_of[std::size_t(bins[i])] = int(i);
    parts_->centres[int64_t(i)][0] = centre.a;
    parts_->centres[int64_t(i)][1] = centre.b;
  }
  parts_->labels = std::make_unique<LabelTable>(class_of);
  if (!recipe.builtin.empty()) {
    parts_->builtin = load_colorizer_weights(recipe.builtin);
    prepare_for_answers(*parts_->builtin->network);
  }
  parts_->net = UNet(recipe, int(bins.size()));
  initialise(parts_->net, seed);
}

ReferenceNetwork::~ReferenceNetwork() = default;
ReferenceNetwork::ReferenceNetwork(ReferenceNetwork&&) noexcept = default;

void ReferenceNetwork::fit(std::span<const ReferenceImage> images, const ProgressSink& progress) {
  const ReferenceRecipe& recipe = parts_->recipe;
  const SingleThreadedOps single;
  std::vector<Tensor> parameters = parts_->net->parameters();
  torch::optim::AdamW optimizer(
      parameters,
      torch::optim::AdamWOptions(recipe.learning_rate).weight_decay(recipe.weight_decay).betas({0.9, 0.99}));
  std::vector<std::vector<Patches>> held(std::size_t(recipe.shards));
  double smoothed = 0;
  for (int step = 0; step < recipe.steps; ++step) {
    if (interruption_requested()) throw Interrupted("stopped while fitting the reference network; nothing was kept");
    std::vector<std::vector<Tensor>> gradients(std::size_t(recipe.shards));
    std::vector<double> losses(std::size_t(recipe.shards));
    parallel_tasks(std::size_t(recipe.shards), [&](std::size_t shard) {
      at::init_num_threads();
      const Patches& patches = parts_->patches_of(images, step, int(shard), held[shard]);
      gradients[shard] = parts_->gradients(patches, &losses[shard]);
    });
    torch::NoGradGuard no_grad;
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      Tensor sum = gradients[0][i].clone();
      for (std::size_t shard = 1; shard < gradients.size(); ++shard) sum += gradients[shard][i];
      parameters[i].mutable_grad() = sum / recipe.shards;
    }
    const double done = double(step) / recipe.steps, warm = std::min(1.0, (step + 1) / 30.0);
    const double rate = recipe.learning_rate * warm * 0.5 * (1 + std::cos(std::numbers::pi * done));
    static_cast<torch::optim::AdamWOptions&>(optimizer.param_groups()[0].options()).lr(rate);
    torch::nn::utils::clip_grad_norm_(parameters, 1.0);
    optimizer.step();
    double loss = 0;
    for (double value : losses) loss += value / recipe.shards;
    smoothed = step == 0 ? loss : 0.95 * smoothed + 0.05 * loss;
    if (progress && step % 10 == 9) {
      progress({"reference colorizer", double(step + 1) / recipe.steps, {{"loss", smoothed}}});
    }
  }
}

ChromaBatch ReferenceNetwork::colorize(const LightnessBatch& patches) const {
  static_assert(ColorizerNetImpl::kInputMultiple == Encoder::kInputMultiple);
  const SingleThreadedOps single;
  const int64_t height = patches.height, width = patches.width, pixels = height * width;
  const int64_t multiple = std::max(int64_t(1) << parts_->recipe.channels.size(),
                                    parts_->builtin || parts_->recipe.encoder ? ColorizerNetImpl::kInputMultiple : 1);
  const auto rounded = [&](int64_t n) { return (n + multiple - 1) / multiple * multiple; };
  ChromaBatch answer{patches.batch, patches.height, patches.width, {}, {}};
  answer.ab.resize(std::size_t(patches.batch) * 2 * std::size_t(pixels));
  answer.certainty.resize(std::size_t(patches.batch) * std::size_t(pixels));
  parallel_tasks(std::size_t(patches.batch), [&](std::size_t i) {
    at::init_num_threads();
    torch::NoGradGuard no_grad;
    Tensor lightness =
        torch::from_blob(const_cast<float*>(patches.lightness.data()) + i * std::size_t(pixels), {1, 1, height, width});
    lightness = torch::replication_pad2d(lightness, {0, rounded(width) - width, 0, rounded(height) - height});
    lightness = torch::cat({lightness, lightness.flip({3})});
    UNet net(parts_->net);
    const Tensor out = net->forward(UNetImpl::features(lightness), parts_->guidance(lightness));
    Tensor said = torch::cat({parts_->decode(out), certainty_map(out)}, 1);
    said = (said.slice(0, 0, 1) + said.slice(0, 1, 2).flip({3})) / 2;
    said = torch::upsample_bilinear2d(said, {rounded(height), rounded(width)}, false);
    said = said.slice(2, 0, height).slice(3, 0, width).contiguous();
    const float* values = said.data_ptr<float>();
    std::copy_n(values, 2 * pixels, answer.ab.data() + i * 2 * std::size_t(pixels));
    std::copy_n(values + 2 * pixels, pixels, answer.certainty.data() + i * std::size_t(pixels));
  });
  return answer;
}

std::vector<float> ReferenceNetwork::weights() const {
  std::vector<float> all;
  for (const Tensor& parameter : parts_->net->parameters()) {
    const Tensor flat = parameter.detach().contiguous();
    all.insert(all.end(), flat.data_ptr<float>(), flat.data_ptr<float>() + flat.numel());
  }
  return all;
}

void ReferenceNetwork::set_weights(std::span<const float> weights) {
  torch::NoGradGuard no_grad;
  std::size_t at = 0;
  for (Tensor& parameter : parts_->net->parameters()) {
    const auto count = std::size_t(parameter.numel());
    CNERF_CHECK(at + count <= weights.size(), "too few weights");
    parameter.copy_(torch::from_blob(const_cast<float*>(weights.data()) + at, parameter.sizes()));
    at += count;
  }
  CNERF_CHECK_EQ(at, weights.size());
}

}  // namespace cnerf
