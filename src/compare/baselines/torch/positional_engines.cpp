// The paper's own field by LibTorch: see positional_field.h.

#include <torch/torch.h>

#include <algorithm>
#include <cmath>

#include "src/base/aabb.h"
#include "src/base/check.h"
#include "src/base/parallel.h"
#include "src/color/ab_bins.h"
#include "src/compare/baselines/torch/factories.h"
#include "src/compare/baselines/torch/positional_math.h"
#include "src/engine/heaviest_samples.h"
#include "src/field/luminance_activation.h"
#include "src/render/observed_ray.h"

namespace cnerf::compare {
namespace {

constexpr int kTrunkWidth = 256, kTrunkLayers = 8, kSkipBehind = 4, kHeadWidth = 128;
constexpr std::int64_t kEncodedPosition = 3 * (1 + 2 * kPositionFrequencies);
constexpr std::int64_t kEncodedDirection = 3 * (1 + 2 * kDirectionFrequencies);
constexpr std::int64_t kPointsAtATime = 1 << 17;  // bounds the memory of activations without gradients
constexpr std::uint64_t kChromaStream = named_stream("chroma");

torch::Device device() {
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
  return torch::from_blob(const_cast<Value*>(values.data()), shape, type).clone().to(device());
}
std::vector<float> floats_of(const torch::Tensor& values) {
  const torch::Tensor host = values.detach().to(torch::kCPU).contiguous();
  return {host.data_ptr<float>(), host.data_ptr<float>() + host.numel()};
}

/// The same numbers on every device.
torch::Tensor uniform(std::uint64_t seed, std::uint64_t stream, torch::IntArrayRef shape) {
  torch::Generator generator = torch::make_generator<torch::CPUGeneratorImpl>(mix_bits(seed ^ mix_bits(stream)));
  return torch::rand(shape, generator, torch::kFloat32).to(device());
}

/// Uniform in +-1 / sqrt(inputs), LibTorch's own bounds of a linear layer, but of our seed.
void initialise(torch::nn::Module& module, std::uint64_t seed) {
  const torch::NoGradGuard no_gradient;
  std::uint64_t stream = 0;
  for (const auto& child : module.modules(/*include_self=*/false)) {
    auto* linear = child->as<torch::nn::Linear>();
    if (linear == nullptr) continue;
    const double bound = 1.0 / std::sqrt(double(linear->weight.size(1)));
    for (torch::Tensor& parameter : linear->parameters()) {
      parameter.copy_((2 * uniform(seed, ++stream, parameter.sizes()) - 1) * bound);
    }
  }
}

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

/// Theta_Z up to its last layer, which is linear and so comes after compositing, once a pixel.
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
  explicit Trained(const std::vector<torch::Tensor>& parameters) : parameters_(parameters) {
    const torch::NoGradGuard no_gradient;
    std::vector<torch::Tensor> flat;
    for (const torch::Tensor& parameter : parameters_) flat.push_back(parameter.detach().flatten());
    values_ = torch::cat(flat);
    mean_ = torch::zeros_like(values_);
    square_ = torch::zeros_like(values_);
    std::int64_t begin = 0;
    for (torch::Tensor& parameter : parameters_) {  // from now on, a part of `values_`
      parameter.set_data(values_.narrow(0, begin, parameter.numel()).view(parameter.sizes()));
      begin += parameter.numel();
    }
  }

  /// Follows the gradients and forgets them.  @param step  1 for the first
  void follow(double learning_rate, std::int64_t step) {
    const torch::NoGradGuard no_gradient;
    constexpr double kMeanDecay = 0.9, kSquareDecay = 0.999, kTiny = 1e-8;
    std::vector<torch::Tensor> flat;
    for (torch::Tensor& parameter : parameters_) {
      flat.push_back(parameter.grad().defined() ? parameter.grad().flatten() : torch::zeros_like(parameter).flatten());
    }
    const torch::Tensor gradient = torch::cat(flat);
    for (torch::Tensor& parameter : parameters_) parameter.mutable_grad() = torch::Tensor();
    mean_.mul_(kMeanDecay).add_(gradient, 1 - kMeanDecay);
    square_.mul_(kSquareDecay).addcmul_(gradient, gradient, 1 - kSquareDecay);
    const double unbiased_mean = 1 - std::pow(kMeanDecay, double(step));
    const double unbiased_square = 1 - std::pow(kSquareDecay, double(step));
    values_.addcdiv_(mean_, (square_ / unbiased_square).sqrt_().add_(kTiny), -learning_rate / unbiased_mean);
  }

  void append_state(const std::string& prefix, std::vector<StatePiece>& state) {
    host_ = {values_.to(torch::kCPU), mean_.to(torch::kCPU), square_.to(torch::kCPU)};
    const char* names[] = {".values", ".mean", ".square"};
    for (std::size_t i = 0; i < host_.size(); ++i) {
      auto* bytes = reinterpret_cast<std::byte*>(host_[i].data_ptr<float>());
      state.push_back({prefix + names[i], {bytes, sizeof(float) * std::size_t(host_[i].numel())}});
    }
  }
  void state_loaded() {
    const torch::NoGradGuard no_gradient;
    values_.copy_(host_.at(0));
    mean_.copy_(host_.at(1));
    square_.copy_(host_.at(2));
  }

 private:
  std::vector<torch::Tensor> parameters_;
  torch::Tensor values_, mean_, square_;
  std::vector<torch::Tensor> host_;  // on the processor, of the same memory as those or a copy
};

std::vector<torch::Tensor> joined(std::vector<torch::Tensor> a, const std::vector<torch::Tensor>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

/// Rays on the device with the interval that samples come from.
struct RayTensors {
  torch::Tensor origin, direction;  // [R, 3]
  torch::Tensor begin, end;         // [R, 1]
};

class PositionalLuminanceEngine final : public LuminanceEngine {
 public:
  PositionalLuminanceEngine(const LuminanceEngineOptions& options, const PositionalRays& rays)
      : options_(options),
        rays_(rays),
        brightest_(LuminanceActivation<double>::up_to(options.max_luminance).brightest),
        density_scale_(1.0 / std::ldexp(1.0, 1 - options.cascades)),
        coarse_(placed(options.seed)),
        fine_(placed(options.seed ^ 1)),
        trained_(joined(coarse_->parameters(), fine_->parameters())),
        occupancy_(options.occupancy, options.cascades) {}

  void set_views(const std::vector<TrainingView>& views) override { views_ = views; }
  StepReport step(float learning_rate) override {
    CNERF_CHECK(!views_.empty(), "no training views");
    const FastProducts fast;
    const std::size_t n = rays_a_step();
    // The same pixels and backgrounds as the hash grid's engines draw.
    std::vector<Ray> rays(n);
    std::vector<float> backgrounds(n), targets(n), wanted_light(n);
    parallel_ranges(n, 64, [&](std::size_t begin, std::size_t end) {
      for (std::size_t r = begin; r < end; ++r) {
        const ObservedRay observed =
            observe_ray(views_, options_.sampling(), options_.seed, std::uint64_t(counters_[0]), r);
        rays[r] = observed.ray, backgrounds[r] = observed.target.background;
        targets[r] = observed.target.luminance, wanted_light[r] = observed.target.wanted();
      }
    });
    const torch::Tensor behind = tensor_of(backgrounds, {std::int64_t(n)}, torch::kFloat32);
    const torch::Tensor wanted = tensor_of(wanted_light, {std::int64_t(n)}, torch::kFloat32);
    const RayTensors where = on_device(rays);
    const torch::Tensor coarse_t =
        coarse_distances(where, uniform(options_.seed, noise(0), {std::int64_t(n), kCoarseSamples}));
    const Seen coarse = look(coarse_, where, coarse_t);
    const torch::Tensor t = fine_distances(where, coarse_t, coarse.weights,
                                           uniform(options_.seed, noise(1), {std::int64_t(n), kFineSamples}));
    const Seen fine = look(fine_, where, t);
    const auto loss_of = [&](const Seen& seen) {
      const torch::Tensor light = seen.luminance_of_rays() + (1 - seen.weights.sum(1)) * behind;
      return ((positional::lightness(light) - positional::lightness(wanted)) / 100).square().mean();
    };
    const torch::Tensor fine_loss = loss_of(fine);
    (fine_loss + loss_of(coarse)).backward();
    counters_[0] += 1;
    trained_.follow(double(learning_rate), counters_[0]);

    StepReport report;
    report.loss = fine_loss.item<double>();
    const std::vector<float> seen = floats_of(fine.luminance_of_rays());
    for (std::size_t r = 0; r < n; ++r) {
      const float error =
          srgb_from_linear(std::clamp(seen[r], 0.0f, 1.0f)) - srgb_from_linear(std::clamp(targets[r], 0.0f, 1.0f));
      report.squared_error += error * error / double(n);
    }
    report.rays = n;
    report.marched_samples = report.trained_samples = n * (2 * kCoarseSamples + kFineSamples);
    return report;
  }
  [[nodiscard]] long step_count() const override { return counters_[0]; }

  void render(std::span<const Ray> rays, const MarchSettings&, const RenderEffort& effort,
              std::span<RayResult> results) const override {
    CNERF_CHECK_EQ(rays.size(), results.size());
    for_parts(rays, [&](std::size_t first, const torch::Tensor& t, const Seen& seen) {
      const std::vector<float> luminance = floats_of(seen.luminance_of_rays());
      const torch::Tensor opacity = seen.weights.sum(1);
      const std::vector<float> a = floats_of(opacity);
      const std::vector<float> depth = floats_of((seen.weights * t).sum(1) / opacity.clamp_min(1e-6));
      for (std::size_t r = 0; r < a.size(); ++r) {
        const float counted = effort.opacity_of(a[r]);
        results[first + r] = {counted > a[r] ? luminance[r] / a[r] : luminance[r], counted, depth[r]};
      }
    });
  }

  void trace(std::span<const Ray> rays, const MarchSettings&, const RenderEffort& effort,
             std::vector<WeightedSample>& samples, std::vector<std::size_t>& offsets) const override {
    constexpr std::size_t kSamples = kCoarseSamples + kFineSamples;
    samples.clear();
    offsets.assign(1, 0);
    for_parts(rays, [&](std::size_t, const torch::Tensor& t, const Seen& seen) {
      const std::vector<float> distance = floats_of(t), weight = floats_of(seen.weights),
                               luminance = floats_of(seen.luminance);
      std::vector<WeightedSample> part(distance.size());
      for (std::size_t s = 0; s < part.size(); ++s) part[s] = {distance[s], weight[s], luminance[s]};
      std::vector<std::size_t> ends;
      for (std::size_t s = 0; s <= part.size(); s += kSamples) ends.push_back(s);
      keep_heaviest(effort, part, ends);
      for (std::size_t r = 1; r < ends.size(); ++r) offsets.push_back(samples.size() + ends[r]);
      samples.insert(samples.end(), part.begin(), part.end());
    });
  }

  void query_density(std::span<const Vec3f> positions, std::span<float> sigma) const override {
    const torch::NoGradGuard no_gradient;
    for_points(positions, [&](std::size_t first, const torch::Tensor& points) {
      std::ranges::copy(floats_of(positional::density(fine_->raw_density(points), density_scale_)),
                        sigma.begin() + std::ptrdiff_t(first));
    });
  }
  void query_luminance(std::span<const Vec3f> positions, std::span<const Vec3f> directions,
                       std::span<float> luminance) const override {
    const torch::NoGradGuard no_gradient;
    for_points(positions, [&](std::size_t first, const torch::Tensor& points) {
      const torch::Tensor seen = vectors(directions.subspan(first, std::size_t(points.size(0))));
      std::ranges::copy(floats_of(positional::emitted_luminance(fine_->forward(points, seen).luminance, brightest_)),
                        luminance.begin() + std::ptrdiff_t(first));
    });
  }
  /// Everything counts as occupied: this field has no such grid.
  [[nodiscard]] const OccupancyGrid& occupancy() const override { return occupancy_; }
  void exclude(const std::function<bool(Vec3f, float)>&) override {}

  [[nodiscard]] std::vector<StatePiece> state() override {
    std::vector<StatePiece> state;
    trained_.append_state("positional", state);
    state.push_back(state_piece("positional.steps", counters_));
    return state;
  }
  void state_loaded() override { trained_.state_loaded(); }

  /// w, of which stage 2 takes a copy.
  [[nodiscard]] Trunk encoding() const { return fine_->trunk; }

 private:
  struct Seen {
    torch::Tensor weights, luminance;  // [R, S]
    [[nodiscard]] torch::Tensor luminance_of_rays() const { return (weights * luminance).sum(1); }
  };

  static LuminanceNet placed(std::uint64_t seed) {
    LuminanceNet net;
    net->to(device());
    initialise(*net, seed);
    return net;
  }

  [[nodiscard]] std::size_t rays_a_step() const {
    return std::size_t(std::max(16, options_.samples_per_step / (2 * kCoarseSamples + kFineSamples)));
  }
  [[nodiscard]] std::uint64_t noise(std::uint64_t which) const { return 2 * std::uint64_t(counters_[0]) + which; }

  static torch::Tensor vectors(std::span<const Vec3f> all) {
    static_assert(sizeof(Vec3f) == 3 * sizeof(float));
    return torch::from_blob(const_cast<Vec3f*>(all.data()), {std::int64_t(all.size()), 3}, torch::kFloat32)
        .clone()
        .to(device());
  }

  [[nodiscard]] RayTensors on_device(std::span<const Ray> rays) const {
    std::vector<Vec3f> origins, directions;
    std::vector<float> begin, end;
    for (const Ray& ray : rays) {
      const auto inside = intersect(Aabbf{{0, 0, 0}, {1, 1, 1}}, ray.origin, ray.direction);
      origins.push_back(ray.origin);
      directions.push_back(ray.direction);
      begin.push_back(std::max(inside ? inside->begin : 0.0f, rays_.near));
      end.push_back(std::max(inside ? inside->end : 0.0f, begin.back() + 1e-3f));  // misses meet next to nothing
    }
    const auto n = std::int64_t(rays.size());
    return {vectors(origins), vectors(directions), tensor_of(begin, {n, 1}, torch::kFloat32),
            tensor_of(end, {n, 1}, torch::kFloat32)};
  }

  /// One distance in each of equal parts of the interval.  @param u  [R, 64], where in its part
  [[nodiscard]] torch::Tensor coarse_distances(const RayTensors& rays, const torch::Tensor& u) const {
    const torch::Tensor share = (torch::arange(kCoarseSamples, u.options()) + u) / kCoarseSamples;
    if (!rays_.in_disparity) return rays.begin + share * (rays.end - rays.begin);
    return 1 / ((1 - share) / rays.begin + share / rays.end);
  }
  /// Those and as many where the coarse net saw something.
  [[nodiscard]] static torch::Tensor fine_distances(const RayTensors& rays, const torch::Tensor& coarse,
                                                    const torch::Tensor& weights, const torch::Tensor& u) {
    const torch::NoGradGuard no_gradient;
    const torch::Tensor middles = (coarse.slice(1, 1) + coarse.slice(1, 0, -1)) / 2;
    const torch::Tensor edges = torch::cat({rays.begin, middles, rays.end}, 1);
    const torch::Tensor even = (torch::arange(kFineSamples, u.options()) + u) / kFineSamples;
    const torch::Tensor fine = positional::inverse_transform(edges, weights.detach(), even);
    return std::get<0>(torch::cat({coarse, fine}, 1).sort(1));
  }

  /// @param t  [R, S], rising
  [[nodiscard]] Seen look(LuminanceNet& net, const RayTensors& rays, const torch::Tensor& t) const {
    const std::int64_t n = t.size(0), s = t.size(1);
    const torch::Tensor points = rays.origin.unsqueeze(1) + t.unsqueeze(2) * rays.direction.unsqueeze(1);
    const torch::Tensor directions = rays.direction.unsqueeze(1).expand({n, s, 3});
    const auto raw = net->forward(points.reshape({-1, 3}).clamp(0, 1), directions.reshape({-1, 3}));
    const torch::Tensor dt = torch::cat({t.slice(1, 1), rays.end}, 1) - t;
    return {positional::weights(positional::density(raw.density.view({n, s}), density_scale_), dt.clamp_min(0)),
            positional::emitted_luminance(raw.luminance.view({n, s}), brightest_)};
  }

  /// Looks along rays as pictures are made: samples in the middle of their parts.
  template <typename Use>
  void for_parts(std::span<const Ray> rays, Use&& use) const {
    const torch::NoGradGuard no_gradient;
    const FastProducts fast;
    constexpr std::size_t kRays = kPointsAtATime / (kCoarseSamples + kFineSamples);
    for (std::size_t first = 0; first < rays.size(); first += kRays) {
      const RayTensors part = on_device(rays.subspan(first, std::min(kRays, rays.size() - first)));
      const auto middle = [&](std::int64_t samples) {
        return torch::full({part.origin.size(0), samples}, 0.5, part.origin.options());
      };
      const torch::Tensor coarse_t = coarse_distances(part, middle(kCoarseSamples));
      const torch::Tensor t =
          fine_distances(part, coarse_t, look(coarse_, part, coarse_t).weights, middle(kFineSamples));
      use(first, t, look(fine_, part, t));
    }
  }
  template <typename Use>
  static void for_points(std::span<const Vec3f> positions, Use&& use) {
    for (std::size_t first = 0; first < positions.size(); first += std::size_t(kPointsAtATime)) {
      use(first, vectors(positions.subspan(first, std::min(std::size_t(kPointsAtATime), positions.size() - first))));
    }
  }

  LuminanceEngineOptions options_;
  PositionalRays rays_;
  double brightest_, density_scale_;
  mutable LuminanceNet coarse_, fine_;  // modules know no const
  Trained trained_;
  std::vector<std::int64_t> counters_ = {0};  // steps
  std::vector<TrainingView> views_;
  OccupancyGrid occupancy_;
};

class PositionalColorBinEngine final : public ColorBinEngine {
 public:
  /// @param encoding  w to begin with; empty = random
  PositionalColorBinEngine(std::uint64_t seed, Trunk encoding, bool trains_encoding)
      : trains_encoding_(trains_encoding) {
    trunk_->to(device());
    net_->to(device());
    initialise(*trunk_, seed ^ kChromaStream);
    initialise(*net_, seed);
    const torch::NoGradGuard no_gradient;
    if (!encoding.is_empty()) {
      const std::vector<torch::Tensor> from = encoding->parameters();
      std::vector<torch::Tensor> to = trunk_->parameters();
      for (std::size_t i = 0; i < from.size(); ++i) to[i].copy_(from[i]);
    }
    trained_ = std::make_unique<Trained>(joined(net_->parameters(), trunk_->parameters()));
  }

  using ColorBinEngine::step;
  double step(const PixelSamples& pixels, std::span<const SoftLabel> labels, std::span<const float> pixel_weights,
              const ChromaLossWeights& more, float learning_rate) override {
    CNERF_CHECK_EQ(labels.size(), pixels.pixels());
    const FastProducts fast;
    const auto n = std::int64_t(labels.size());
    std::vector<std::int64_t> bins;
    std::vector<float> shares, weights(pixel_weights.begin(), pixel_weights.end());
    if (weights.empty()) weights.assign(labels.size(), 1.0f);
    for (const SoftLabel& label : labels) {
      bins.insert(bins.end(), label.bin.begin(), label.bin.end());
      shares.insert(shares.end(), label.weight.begin(), label.weight.end());
    }
    const Composited seen = forward(pixels, 0, pixels.pixels());
    const torch::Tensor logits = net_->classes->forward(seen.features),
                        pixel_weight = tensor_of(weights, {n}, torch::kFloat32);
    torch::Tensor loss =
        positional::classification_loss(logits, tensor_of(bins, {n, kSoftLabelBins}, torch::kInt64),
                                        tensor_of(shares, {n, kSoftLabelBins}, torch::kFloat32), pixel_weight);
    if (more.spread > 0) loss = loss + more.spread * seen.spread() / n;
    if (more.regression > 0) {
      std::vector<float> wanted, centres;
      for (const SoftLabel& label : labels) wanted.insert(wanted.end(), {mean_of(label).a, mean_of(label).b});
      for (const Ab centre : ab_bin_centres()) centres.insert(centres.end(), {centre.a, centre.b});
      const torch::Tensor mean =
          torch::softmax(logits, 1).matmul(tensor_of(centres, {kAbBinCount, 2}, torch::kFloat32));
      const torch::Tensor cost = torch::smooth_l1_loss(mean, tensor_of(wanted, {n, 2}, torch::kFloat32),
                                                       at::Reduction::None, double(kSmoothMean));
      loss = loss + more.regression * (cost.sum(1) * pixel_weight).mean();
    }
    loss.backward();
    steps_.front() += 1;
    trained_->follow(double(learning_rate), steps_.front());
    return loss.item<double>();
  }

  void logits(const PixelSamples& pixels, std::span<float> logits) const override {
    CNERF_CHECK_EQ(logits.size(), pixels.pixels() * kAbBinCount);
    for_parts(pixels, [&](std::size_t first, const std::vector<float>& part) {
      std::ranges::copy(part, logits.begin() + std::ptrdiff_t(first * kAbBinCount));
    });
  }
  void decode(const PixelSamples& pixels, float temperature, std::span<Ab> colors) const override {
    CNERF_CHECK_EQ(colors.size(), pixels.pixels());
    for_parts(pixels, [&](std::size_t first, const std::vector<float>& part) {
      parallel_ranges(part.size() / kAbBinCount, 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t p = begin; p < end; ++p) {
          const auto of_pixel = std::span(part).subspan(p * kAbBinCount, kAbBinCount);
          colors[first + p] = temperature > 0 ? decode_annealed_mean(of_pixel, temperature) : decode_arg_max(of_pixel);
        }
      });
    });
  }

  [[nodiscard]] long step_count() const override { return steps_.front(); }
  [[nodiscard]] std::vector<StatePiece> state() override {
    std::vector<StatePiece> state;
    trained_->append_state("positional_chroma", state);
    state.push_back(state_piece("chroma_steps", steps_));
    return state;
  }
  void state_loaded() override { trained_->state_loaded(); }

 private:
  struct Composited {
    torch::Tensor features;  ///< [R, kHeadWidth]
    torch::Tensor hidden;    ///< [S, kHeadWidth], features of samples
    torch::Tensor share;     ///< [S, 1]

    /// Sum over pixels (chroma_math.h).
    [[nodiscard]] torch::Tensor spread() const { return (share * hidden.square()).sum() - features.square().sum(); }
  };
  /// Of the pixels in [begin, end).
  [[nodiscard]] Composited forward(const PixelSamples& pixels, std::size_t begin, std::size_t end) const {
    const std::size_t first = pixels.offsets[begin], count = pixels.offsets[end] - first;
    std::vector<std::int64_t> pixel_of(count);
    std::vector<float> share(count), positions;
    for (std::size_t p = begin; p < end; ++p) {
      float opacity = 0;
      for (std::size_t s = pixels.offsets[p]; s < pixels.offsets[p + 1]; ++s) opacity += pixels.weights[s];
      for (std::size_t s = pixels.offsets[p]; s < pixels.offsets[p + 1]; ++s) {
        pixel_of[s - first] = std::int64_t(p - begin);
        share[s - first] = pixels.weights[s] * inverse_opacity(opacity);
        const Vec3f& x = pixels.positions[s];
        positions.insert(positions.end(), {x.x, x.y, x.z});
      }
    }
    const auto n = std::int64_t(count);
    torch::Tensor w;
    {
      const torch::AutoGradMode mode(trains_encoding_ && torch::GradMode::is_enabled());
      w = trunk_->forward(tensor_of(positions, {n, 3}, torch::kFloat32));
    }
    const torch::Tensor hidden = net_->hidden(w), shares = tensor_of(share, {n, 1}, torch::kFloat32);
    const torch::Tensor composited = torch::zeros({std::int64_t(end - begin), kHeadWidth}, hidden.options())
                                         .index_add(0, tensor_of(pixel_of, {n}, torch::kInt64), hidden * shares);
    return {composited, hidden, shares};
  }

  /// Calls `use(first pixel, logits)` for pixels of about kPointsAtATime samples at a time.
  template <typename Use>
  void for_parts(const PixelSamples& pixels, Use&& use) const {
    const torch::NoGradGuard no_gradient;
    const FastProducts fast;
    for (std::size_t begin = 0; begin < pixels.pixels();) {
      std::size_t end = begin + 1;
      while (end < pixels.pixels() && end - begin < std::size_t(kPointsAtATime) &&
             pixels.offsets[end + 1] - pixels.offsets[begin] <= std::size_t(kPointsAtATime)) {
        ++end;
      }
      use(begin, floats_of(net_->classes->forward(forward(pixels, begin, end).features)));
      begin = end;
    }
  }

  bool trains_encoding_;
  mutable Trunk trunk_;  // modules know no const
  mutable ChromaNet net_;
  std::unique_ptr<Trained> trained_;
  std::vector<std::int64_t> steps_ = {0};
};

class PositionalEngines final : public Engines {
 public:
  PositionalEngines(const PositionalRays& rays, bool trains_encoding, const Engines* luminance, const Engines& colors)
      : rays_(rays), trains_encoding_(trains_encoding), luminance_(luminance), colors_(colors) {}
  [[nodiscard]] Device device() const override { return Device::kCpu; }
  [[nodiscard]] std::string description() const override { return "positional encoding, LibTorch"; }
  [[nodiscard]] std::unique_ptr<LuminanceEngine> make_luminance(const LuminanceEngineOptions& options) const override {
    if (luminance_ != nullptr) return luminance_->make_luminance(options);
    auto engine = std::make_unique<PositionalLuminanceEngine>(options, rays_);
    encoding_ = engine->encoding();
    return engine;
  }
  [[nodiscard]] std::unique_ptr<ColorBinEngine> make_color_bins(const HashGridOptions& /*grid*/,
                                                                std::uint64_t seed) const override {
    return std::make_unique<PositionalColorBinEngine>(seed, encoding_, trains_encoding_);
  }
  [[nodiscard]] std::unique_ptr<ColorFieldEngine> make_color_field(const HashGridOptions& grid,
                                                                   std::uint64_t seed) const override {
    return colors_.make_color_field(grid, seed);
  }

 private:
  PositionalRays rays_;
  bool trains_encoding_;
  const Engines* luminance_;
  const Engines& colors_;
  mutable Trunk encoding_ = nullptr;  // of the luminance engine made last
};

}  // namespace

std::unique_ptr<Engines> make_positional_engines(const PositionalRays& rays, bool trains_encoding,
                                                 const Engines* luminance, const Engines& colors) {
  return std::make_unique<PositionalEngines>(rays, trains_encoding, luminance, colors);
}

}  // namespace cnerf::compare
