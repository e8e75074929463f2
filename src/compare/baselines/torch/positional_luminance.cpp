// Luminance of the paper's own field: coarse and fine net, importance sampling, compositing.

#include <algorithm>
#include <cmath>

#include "src/base/aabb.h"
#include "src/base/check.h"
#include "src/base/parallel.h"
#include "src/compare/baselines/torch/positional_nets.h"
#include "src/engine/heaviest_samples.h"
#include "src/engine/stage1_loss.h"
#include "src/field/luminance_activation.h"
#include "src/render/observed_ray.h"

namespace cnerf::compare {
namespace {

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
    std::vector<RayTarget> targets(n);
    std::vector<float> backgrounds(n), wanted_light(n);
    parallel_ranges(n, 64, [&](std::size_t begin, std::size_t end) {
      for (std::size_t r = begin; r < end; ++r) {
        const ObservedRay observed = observe_ray(views_, options_.seed, std::uint64_t(counters_[0]), r);
        rays[r] = observed.ray, targets[r] = observed.target;
        backgrounds[r] = observed.target.background + observed.target.sky, wanted_light[r] = observed.target.wanted();
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
    const std::vector<float> seen = floats_of(fine.luminance_of_rays()), opacity = floats_of(fine.weights.sum(1));
    for (std::size_t r = 0; r < n; ++r) {
      report.squared_error += squared_error({seen[r], 1 - opacity[r]}, targets[r]) / double(n);
    }
    report.rays = n;
    report.trained_samples = n * (2 * kCoarseSamples + kFineSamples);
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
    net->to(torch_device());
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
        .to(torch_device());
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

}  // namespace

PositionalLuminance make_positional_luminance(const LuminanceEngineOptions& options, const PositionalRays& rays) {
  auto engine = std::make_unique<PositionalLuminanceEngine>(options, rays);
  const Trunk encoding = engine->encoding();
  return {std::move(engine), encoding};
}

}  // namespace cnerf::compare
