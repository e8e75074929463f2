// The engine of stage 1 on the processor. Rays are worked on in blocks of 16, whose samples and activations stay in L2.

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "src/base/check.h"
#include "src/base/parallel.h"
#include "src/engine/cpu/step_chunks.h"
#include "src/engine/heaviest_samples.h"
#include "src/engine/luminance_engine.h"
#include "src/engine/stage1_loss.h"
#include "src/engine/stage1_schedule.h"
#include "src/field/cpu/luminance_field.h"

namespace cnerf {
namespace {

constexpr std::size_t kBlockRays = 16;
constexpr std::size_t kWaveSamples = 8;  // that a ray adds to a wave, see `collect`

/// Positions must lie in [0, 1]; rounding may carry the last sample of a ray just outside.
void set_position(float* positions, std::size_t sample, Vec3f p) {
  const GroupedView<float> grouped(positions, 3);
  for (int axis = 0; axis < 3; ++axis) grouped.at(sample, axis) = std::clamp(p[axis], 0.0f, 1.0f);
}

template <typename Gradients>
std::span<float> floats_of(std::vector<Gradients>& structs) {
  static_assert(sizeof(Gradients) % sizeof(float) == 0);
  return {reinterpret_cast<float*>(structs.data()), structs.size() * sizeof(Gradients) / sizeof(float)};
}

/// Fills the unused lanes of the last group with a legal position.
void pad_positions(AlignedVector<float>& positions, std::size_t samples) {
  for (std::size_t s = samples; s < groups_of(samples) * kGroup; ++s)
    set_position(positions.data(), s, {0.5f, 0.5f, 0.5f});
}

class LuminanceEngineCpu final : public LuminanceEngine {
 public:
  explicit LuminanceEngineCpu(const LuminanceEngineOptions& options);

  void set_views(const std::vector<TrainingView>& views) override;
  void share_steps(const StepShare& share) override { share_ = share; }
  StepReport step(float learning_rate) override;
  [[nodiscard]] long step_count() const override { return counters_.front(); }
  [[nodiscard]] std::vector<ViewCorrection> view_corrections() const override { return corrections_; }
  [[nodiscard]] std::vector<LensCorrection> lens_corrections() const override { return lenses_; }

  void render(std::span<const Ray> rays, const MarchSettings& march, const RenderEffort& effort,
              std::span<RayResult> results) const override;
  void trace(std::span<const Ray> rays, const MarchSettings& march, const RenderEffort& effort,
             std::vector<WeightedSample>& samples, std::vector<std::size_t>& offsets) const override;
  void query_density(std::span<const Vec3f> positions, std::span<float> sigma) const override;
  void query_luminance(std::span<const Vec3f> positions, std::span<const Vec3f> directions,
                       std::span<float> luminance) const override;
  [[nodiscard]] const OccupancyGrid& occupancy() const override { return occupancy_; }
  void exclude(const std::function<bool(Vec3f, float)>& wanted) override { occupancy_.exclude(wanted); }
  [[nodiscard]] std::vector<StatePiece> state() override;
  void state_loaded() override;

 private:
  /// Of which cameras' numbers a block's samples are asked.
  struct Teaching {
    bool camera = false, lens = false;  ///< the lens's are part of the camera's
  };
  [[nodiscard]] Teaching teaching(std::uint32_t ray) const {
    return {options_.learning.teaches_camera(ray), options_.learning.teaches_lens(ray)};
  }
  /// A step of a ray, and the weight that the density-first pass found.
  struct MarchedSample {
    float t = 0, dt = 0, weight = 0;
    std::uint32_t lane = 0;  // of Block::marched
  };
  /// Samples of a block's rays that survive early termination, ray by ray.
  struct Block {
    std::vector<MarchedSample> samples;
    std::vector<std::size_t> offsets;  // [rays + 1]
    AlignedVector<float> positions;    // [G, 3, 16]
    LuminanceWorkspace work;
    AlignedVector<float> d_positions;  // [G, 3, 16]
    // Scratch of the density-first pass.
    std::vector<std::vector<MarchedSample>> of_ray;
    AlignedVector<float> wave_positions, wave_sigma;
    DensityWorkspace marched;  // of all waves, one behind the other
    std::vector<std::uint32_t> lanes;
  };

  /// A ray on its way through occupied space.
  struct Walk {
    RayMarcher marcher;
    float transmittance = 1;  // behind the composited samples
    bool is_open = true;      // lets light through, and has samples left
    std::size_t in_wave = 0;  // samples it added to the wave
  };
  using Walks = std::array<Walk, kBlockRays>;

  /// Marches rays together and keeps the samples in front of the point where a ray becomes opaque.
  ///
  /// How many samples a ray needs is only known once their densities are, and densities are computed 16 at a time. So
  /// the block's rays advance in waves: each open ray adds up to kWaveSamples samples to the wave (`march_wave`), one
  /// call computes the densities of the whole wave, then each ray composites its own samples and closes where it
  /// becomes opaque (`composite_wave`). What lies hidden behind a surface costs at most the rest of one wave.
  void collect(std::span<const Ray> rays, std::span<const float> jitter, const MarchSettings& march,
               float min_transmittance, Block& block) const;
  /// Returns the number of samples in the wave; their positions go to `block.wave_positions`.
  /// @param first  group of `block.marched` that the wave begins at
  static std::size_t march_wave(std::span<const Ray> rays, std::size_t first, Walks& walks, Block& block);
  /// Weights the wave's samples by the densities in `block.wave_sigma`; drops those behind the end of a ray.
  static void composite_wave(float min_transmittance, std::span<Walk> walks, Block& block);
  /// `collect` from the middle of each step, and of what it keeps the heaviest samples.
  void collect_for_picture(std::span<const Ray> rays, const MarchSettings& march, const RenderEffort& effort,
                           Block& block) const;
  /// The light of a block's samples, from what the density-first pass computed.
  /// @param for_training  as well what gradients want: positions and the density net's activations
  void shade(std::span<const Ray> rays, bool for_training, Block& block) const;
  /// Samples, loss and gradients of a block's rays.
  void train_block(std::span<const ObservedRay> rays, float gradient_scale, Teaching teaching, Block& block,
                   StepChunk& chunk) const;
  /// Loss of one ray of a shaded block; sets the gradients of its samples.
  void train_ray(const ObservedRay& ray, std::size_t index, float gradient_scale, Block& block, StepChunk& chunk) const;
  /// What the block's samples say of the poses of their views, and of their lenses.
  void add_camera_gradients(std::span<const ObservedRay> rays, const float* d_encoded, Teaching teaching, Block& block,
                            StepChunk& chunk) const;
  /// What a step adds up beside the table's gradient.
  struct StepSums {
    std::vector<float> d_weights;
    std::vector<ViewGradient> d_views;
    std::vector<LensGradient> d_lenses;
    StepReport report;
  };
  /// Of the chunks, and of all processes that share the step.
  [[nodiscard]] StepSums sums() const;
  void update_corrections(const StepSums& sums, float learning_rate);
  void update_lenses(const StepSums& sums, const AdamStep& adam);
  /// Gives the views' cameras the lenses that were learned.
  void use_lenses();
  [[nodiscard]] StepReport report() const;

  LuminanceEngineOptions options_;
  LuminanceFieldCpu field_;
  OccupancyGrid occupancy_;
  std::vector<TrainingView> views_;
  std::vector<ViewCorrection> corrections_;  // of the views, where they are learned
  std::vector<ViewMoments> correction_moments_;
  std::vector<LensCorrection> lenses_;  // likewise; the views' cameras have them
  std::vector<LensMoments> lens_moments_;
  std::vector<Intrinsics> given_lenses_;  // of each view
  std::vector<std::int64_t> counters_;    // steps done, rays of the next step
  StepShare share_;
  StepChunks chunks_;
  mutable tbb::enumerable_thread_specific<Block> blocks_;
};

LuminanceEngineCpu::LuminanceEngineCpu(const LuminanceEngineOptions& options)
    : options_(options),
      field_(options.grid, 1.0f / std::ldexp(1.0f, 1 - options.cascades), options.max_luminance, options.seed),
      occupancy_(options.occupancy, options.cascades),
      corrections_(std::size_t(options.learning.views)),
      correction_moments_(std::size_t(options.learning.views)),
      lenses_(std::size_t(options.learning.lenses)),
      lens_moments_(std::size_t(options.learning.lenses)),
      counters_{0, first_rays(options.samples_per_step)},
      chunks_(std::size_t(options.learning.views), std::size_t(options.learning.lenses)) {}

void LuminanceEngineCpu::set_views(const std::vector<TrainingView>& views) {
  if (options_.learning.is_on()) CNERF_CHECK_EQ(views.size(), corrections_.size());
  views_ = views;
  given_lenses_.clear();
  for (const TrainingView& view : views) given_lenses_.push_back(view.camera.intrinsics);
  use_lenses();
}

void LuminanceEngineCpu::use_lenses() {
  if (lenses_.empty()) return;
  for (std::size_t v = 0; v < views_.size(); ++v) {
    views_[v].camera.intrinsics = lenses_[std::size_t(views_[v].lens)].applied_to(given_lenses_[v]);
  }
}

void LuminanceEngineCpu::collect(std::span<const Ray> rays, std::span<const float> jitter, const MarchSettings& march,
                                 float min_transmittance, Block& block) const {
  Walks walks;
  block.of_ray.resize(kBlockRays);
  for (std::size_t r = 0; r < rays.size(); ++r) {
    walks[r].marcher = RayMarcher(occupancy_, march, rays[r], jitter[r]);
    block.of_ray[r].clear();
  }
  ensure_size(block.wave_positions, kBlockRays * kWaveSamples * 3);
  ensure_size(block.wave_sigma, kBlockRays * kWaveSamples);

  std::size_t first = 0;
  while (const std::size_t count = march_wave(rays, first, walks, block)) {
    pad_positions(block.wave_positions, count);
    field_.density(block.wave_positions.data(), groups_of(count), block.marched, first, block.wave_sigma.data());
    first += groups_of(count);
    composite_wave(min_transmittance, std::span(walks).first(rays.size()), block);
  }

  block.samples.clear();
  block.offsets.assign(1, 0);
  for (std::size_t r = 0; r < rays.size(); ++r) {
    block.samples.insert(block.samples.end(), block.of_ray[r].begin(), block.of_ray[r].end());
    block.offsets.push_back(block.samples.size());
  }
}

std::size_t LuminanceEngineCpu::march_wave(std::span<const Ray> rays, std::size_t first, Walks& walks, Block& block) {
  std::size_t count = 0;
  for (std::size_t r = 0; r < rays.size(); ++r) {
    Walk& walk = walks[r];
    RaySample sample;
    for (walk.in_wave = 0; walk.is_open && walk.in_wave < kWaveSamples; ++walk.in_wave) {
      if (block.of_ray[r].size() >= std::size_t(kMostSamplesOfRay) || !walk.marcher.next(sample)) {
        walk.is_open = false;
        break;
      }
      set_position(block.wave_positions.data(), count, rays[r].at(sample.t));
      block.of_ray[r].push_back({sample.t, sample.dt, 0.0f, std::uint32_t(first * kGroup + count)});
      ++count;
    }
  }
  return count;
}

void LuminanceEngineCpu::composite_wave(float min_transmittance, std::span<Walk> walks, Block& block) {
  const float* sigma = block.wave_sigma.data();
  for (std::size_t r = 0; r < walks.size(); ++r) {
    Walk& walk = walks[r];
    std::vector<MarchedSample>& kept = block.of_ray[r];
    const std::size_t first = kept.size() - walk.in_wave;
    for (std::size_t i = 0; i < walk.in_wave; ++i) {
      MarchedSample& sample = kept[first + i];
      const float alpha = alpha_of(sigma[i], sample.dt);
      sample.weight = walk.transmittance * alpha;
      walk.transmittance *= 1.0f - alpha;
      if (walk.transmittance < min_transmittance) {
        kept.resize(first + i + 1);
        walk.is_open = false;
        break;
      }
    }
    sigma += walk.in_wave;
  }
}

void LuminanceEngineCpu::collect_for_picture(std::span<const Ray> rays, const MarchSettings& march,
                                             const RenderEffort& effort, Block& block) const {
  std::array<float, kBlockRays> middle;
  middle.fill(0.5f);
  collect(rays, middle, march, effort.min_transmittance, block);
  keep_heaviest(effort, block.samples, block.offsets);
}

void LuminanceEngineCpu::shade(std::span<const Ray> rays, bool for_training, Block& block) const {
  const std::size_t groups = groups_of(block.samples.size());
  block.work.resize(groups, field_.encoded_channels());
  block.lanes.clear();
  for (std::size_t r = 0; r < rays.size(); ++r) {
    for (std::size_t s = block.offsets[r]; s < block.offsets[r + 1]; ++s) {
      LuminanceFieldCpu::set_direction(block.work, s, rays[r].direction);
      block.lanes.push_back(block.samples[s].lane);
    }
  }
  for (std::size_t s = block.samples.size(); s < groups * kGroup; ++s) {
    LuminanceFieldCpu::set_direction(block.work, s, {0, 0, 1});
  }
  field_.forward(block.marched, block.lanes, for_training, block.work);
  if (!for_training) return;
  ensure_size(block.positions, groups * 3 * kGroup);
  for (std::size_t r = 0; r < rays.size(); ++r) {
    for (std::size_t s = block.offsets[r]; s < block.offsets[r + 1]; ++s) {
      set_position(block.positions.data(), s, rays[r].at(block.samples[s].t));
    }
  }
  pad_positions(block.positions, block.samples.size());
}

void LuminanceEngineCpu::train_block(std::span<const ObservedRay> rays, float gradient_scale, Teaching teaching,
                                     Block& block, StepChunk& chunk) const {
  std::array<Ray, kBlockRays> plain_rays;
  std::array<float, kBlockRays> jitter{};
  for (std::size_t r = 0; r < rays.size(); ++r) {
    plain_rays[r] = rays[r].ray;
    jitter[r] = rays[r].jitter;
  }
  const std::span<const Ray> block_rays(plain_rays.data(), rays.size());
  collect(block_rays, jitter, options_.march, kTrainingTransmittance, block);
  shade(block_rays, true, block);

  for (std::size_t r = 0; r < rays.size(); ++r) train_ray(rays[r], r, gradient_scale, block, chunk);
  for (std::size_t s = block.samples.size(); s < block.work.groups * kGroup; ++s) {
    field_.set_gradient(block.work, s, 0.0f, 0.0f);
  }
  float* d_encoded = chunk.append(block.positions, block.work.groups, field_.encoded_channels());
  field_.backward(block.work, d_encoded, chunk.d_weights.data());
  if (teaching.camera) add_camera_gradients(rays, d_encoded, teaching, block, chunk);
  chunk.trained += block.samples.size();
}

void LuminanceEngineCpu::train_ray(const ObservedRay& ray, std::size_t index, float gradient_scale, Block& block,
                                   StepChunk& chunk) const {
  const std::size_t begin = block.offsets[index], end = block.offsets[index + 1];
  const ShapeWeights weights = {options_.distortion_weight, options_.depth.weight_at(step_count())};
  const bool has_depth = weights.depth > 0 && ray.target.depth.is_known();
  Compositor<float> light;
  RayShape shape;
  for (std::size_t s = begin; s < end; ++s) {
    const MarchedSample& sample = block.samples[s];
    const float alpha = alpha_of(field_.sigma(block.work, s), sample.dt);
    const float weight = light.add(alpha, field_.luminance(block.work, s));
    if (weights.distortion > 0) shape.distortion.add(weight, {sample.t, sample.dt});
    if (has_depth) shape.depth_miss += weight * depth_miss(sample.t, ray.target.depth);
  }
  if (has_depth) shape.depth_miss += light.transmittance;
  const SeenRay seen{light.value, light.transmittance};
  const RayError error(seen, ray.target);
  chunk.loss += ray_loss(error, shape, weights);
  chunk.squared_error += squared_error(seen, ray.target);

  const RayGradient gradient(error, ray.target.gain, shape, weights, gradient_scale);
  if (options_.learning.exposures) chunk.d_views[ray.view].by_log_gain += gradient.by_log_gain(seen, ray.target);
  float distortion_behind = gradient.distortion_of_all(), depth_behind = shape.depth_miss;
  light = {};
  Distortion<float> before;
  for (std::size_t s = begin; s < end; ++s) {
    const float dt = block.samples[s].dt, luminance = field_.luminance(block.work, s);
    const float weight = light.add(alpha_of(field_.sigma(block.work, s), dt), luminance);
    const LitSample sample{dt, luminance, weight, light.transmittance, light.value};
    float d_sigma = gradient.by_density(sample);
    if (weights.distortion > 0) {
      const LogInterval<float> at(block.samples[s].t, dt);
      const float slope = gradient.distortion_by_weight(weight, at, before);
      before.add(weight, at);
      distortion_behind -= weight * slope;
      d_sigma += gradient.by_density_of_distortion(sample, slope, distortion_behind);
    }
    if (has_depth) {
      const float miss = depth_miss(block.samples[s].t, ray.target.depth);
      depth_behind -= weight * miss;
      d_sigma += gradient.by_density_of_depth(sample, miss, depth_behind);
    }
    field_.set_gradient(block.work, s, d_sigma, gradient.by_luminance(sample));
  }
}

void LuminanceEngineCpu::add_camera_gradients(std::span<const ObservedRay> rays, const float* d_encoded,
                                              Teaching teaching, Block& block, StepChunk& chunk) const {
  ensure_size(block.d_positions, block.work.groups * 3 * kGroup);
  field_.position_gradient(options_.learning.pose_levels(field_.levels()), block.positions.data(), d_encoded,
                           block.work.groups, block.d_positions.data());
  const GroupedView<const float> positions(block.positions, 3), d_positions(block.d_positions, 3);
  const auto at = [](const GroupedView<const float>& grouped, std::size_t s) {
    return Vec3f{grouped.at(s, 0), grouped.at(s, 1), grouped.at(s, 2)};
  };
  for (std::size_t r = 0; r < rays.size(); ++r) {
    ViewGradient& gradient = chunk.d_views[rays[r].view];
    Vec3f by_direction;
    for (std::size_t s = block.offsets[r]; s < block.offsets[r + 1]; ++s) {
      const Vec3f arm = at(positions, s) - rays[r].ray.origin, by_point = at(d_positions, s);
      gradient.add(arm, by_point);
      by_direction += length(arm) * by_point;
    }
    if (!teaching.lens) continue;
    const TrainingView& view = views_[rays[r].view];
    add_lens_gradient(view.camera, given_lenses_[rays[r].view], corrections_[rays[r].view].turn, rays[r].ray.direction,
                      by_direction, chunk.d_lenses[std::size_t(view.lens)]);
  }
}

LuminanceEngineCpu::StepSums LuminanceEngineCpu::sums() const {
  StepSums sums{chunks_.d_weights(), std::vector<ViewGradient>(corrections_.size()),
                std::vector<LensGradient>(lenses_.size()), report()};
  for (const StepChunk& chunk : chunks_.all()) {
    for (std::size_t v = 0; v < sums.d_views.size(); ++v) sums.d_views[v] += chunk.d_views[v];
    for (std::size_t l = 0; l < sums.d_lenses.size(); ++l) sums.d_lenses[l] += chunk.d_lenses[l];
  }
  if (share_.is_whole()) return sums;
  const std::array<std::span<float>, 3> gradients = {sums.d_weights, floats_of(sums.d_views), floats_of(sums.d_lenses)};
  SharedNumbers shared;
  for (const std::span<float> part : gradients) shared.add(part);
  shared.add(float(sums.report.loss));
  shared.add(float(sums.report.squared_error));
  shared.add_count(sums.report.trained_samples);
  shared.sum(share_.sum);
  for (const std::span<float> part : gradients) shared.next(part);
  sums.report.loss = shared.next();
  sums.report.squared_error = shared.next();
  sums.report.trained_samples = shared.next_count();
  return sums;
}

void LuminanceEngineCpu::update_corrections(const StepSums& sums, float learning_rate) {
  const AdamStep adam(learning_rate, step_count());
  const auto n = int(corrections_.size());
  for (std::size_t v = 0; v < corrections_.size(); ++v) {
    update_view(options_.learning, adam, step_count(), sums.d_views[v], correction_moments_[v], corrections_[v]);
  }
  update_lenses(sums, adam);
  if (step_count() % kGaugeEvery != 0) return;
  const auto origin = [&](int v) { return views_[std::size_t(v)].camera.origin.cast<float>(); };
  ViewGauge gauge = pose_gauge(corrections_.data(), n, origin);
  for (int v = 0; v < n; ++v) {
    if (is_median_gain(corrections_.data(), n, v)) gauge.log_gain = corrections_[std::size_t(v)].log_gain;
  }
  for (int v = 0; v < n; ++v) gauge.take_off(origin(v), corrections_[std::size_t(v)]);
}

void LuminanceEngineCpu::update_lenses(const StepSums& sums, const AdamStep& adam) {
  for (std::size_t l = 0; l < lenses_.size(); ++l) {
    const auto first = std::ranges::find(views_, int(l), &TrainingView::lens);
    const Intrinsics& given = given_lenses_[std::size_t(first - views_.begin())];
    update_lens(options_.learning.of_cameras(adam, options_.learning.lens_rate, step_count()), given, sums.d_lenses[l],
                lens_moments_[l], lenses_[l]);
  }
  use_lenses();
}

StepReport LuminanceEngineCpu::report() const {
  StepReport report;
  report.rays = std::size_t(counters_[1]);
  for (const StepChunk& chunk : chunks_.all()) {
    report.loss += chunk.loss / double(report.rays);
    report.squared_error += chunk.squared_error / double(report.rays);
    report.trained_samples += chunk.trained;
  }
  return report;
}

StepReport LuminanceEngineCpu::step(float learning_rate) {
  CNERF_CHECK(!views_.empty(), "no training views");
  const auto step = std::uint64_t(step_count());
  if (updates_occupancy(step_count())) {
    occupancy_.update(occupancy_update(step_count(), options_.seed),
                      [this](std::span<const Vec3f> points, std::span<float> sigma) { query_density(points, sigma); });
  }
  const auto rays = std::size_t(counters_[1]);
  static_assert(kBlockRays == kPoseRayBlock);
  const auto [first, last] = share_.range(rays, kBlockRays);
  const auto work = [&, own = first](StepChunk& chunk, std::size_t from, std::size_t to) {
    const std::size_t begin = own + from, end = own + to;
    std::array<ObservedRay, kBlockRays> observed;
    for (std::size_t r = begin; r < end; ++r) {
      observed[r - begin] = observe_ray(views_, options_.seed, step, r, corrections_);
    }
    train_block({observed.data(), end - begin}, 1.0f / float(rays), teaching(std::uint32_t(begin)), blocks_.local(),
                chunk);
  };
  chunks_.run(last - first, kBlockRays, field_.weight_count(), work);
  const StepSums done = sums();
  counters_[0] += 1;
  field_.update(chunks_.runs(), done.d_weights, learning_rate, counters_[0], share_.sum);
  if (options_.learning.is_on()) update_corrections(done, learning_rate);
  counters_[1] = next_rays(counters_[1], std::int64_t(done.report.trained_samples), options_.samples_per_step);
  return done.report;
}

void LuminanceEngineCpu::render(std::span<const Ray> rays, const MarchSettings& march, const RenderEffort& effort,
                                std::span<RayResult> results) const {
  CNERF_CHECK_EQ(rays.size(), results.size());
  parallel_ranges(rays.size(), kBlockRays, [&](std::size_t begin, std::size_t end) {
    Block& block = blocks_.local();
    const std::span<const Ray> block_rays = rays.subspan(begin, end - begin);
    collect_for_picture(block_rays, march, effort, block);
    shade(block_rays, false, block);
    for (std::size_t r = 0; r < block_rays.size(); ++r) {
      RayResult seen;
      for (std::size_t s = block.offsets[r]; s < block.offsets[r + 1]; ++s) {
        const float weight = block.samples[s].weight;
        seen.luminance += weight * field_.luminance(block.work, s);
        seen.opacity += weight;
        seen.depth += weight * block.samples[s].t;
      }
      if (seen.opacity > 0) seen.depth /= seen.opacity;
      results[begin + r] = seen;
    }
  });
}

void LuminanceEngineCpu::trace(std::span<const Ray> rays, const MarchSettings& march, const RenderEffort& effort,
                               std::vector<WeightedSample>& samples, std::vector<std::size_t>& offsets) const {
  const std::size_t n_blocks = (rays.size() + kBlockRays - 1) / kBlockRays;
  std::vector<std::vector<WeightedSample>> of_block(n_blocks);
  std::vector<std::array<std::size_t, kBlockRays>> counts(n_blocks);
  parallel_tasks(n_blocks, [&](std::size_t b) {
    Block& block = blocks_.local();
    const std::size_t first = b * kBlockRays;
    const std::span<const Ray> block_rays = rays.subspan(first, std::min(kBlockRays, rays.size() - first));
    collect_for_picture(block_rays, march, effort, block);
    shade(block_rays, false, block);
    of_block[b].reserve(block.samples.size());
    for (std::size_t s = 0; s < block.samples.size(); ++s) {
      of_block[b].push_back({block.samples[s].t, block.samples[s].weight, field_.luminance(block.work, s)});
    }
    for (std::size_t r = 0; r < block_rays.size(); ++r) counts[b][r] = block.offsets[r + 1] - block.offsets[r];
  });
  samples.clear();
  offsets.assign(1, 0);
  for (std::size_t b = 0; b < n_blocks; ++b) {
    samples.insert(samples.end(), of_block[b].begin(), of_block[b].end());
    for (std::size_t r = 0; r < std::min(kBlockRays, rays.size() - b * kBlockRays); ++r) {
      offsets.push_back(offsets.back() + counts[b][r]);
    }
  }
}

void LuminanceEngineCpu::query_density(std::span<const Vec3f> positions, std::span<float> sigma) const {
  CNERF_CHECK_EQ(positions.size(), sigma.size());
  constexpr std::size_t kPiece = 512;
  Block& block = blocks_.local();
  for (std::size_t first = 0; first < positions.size(); first += kPiece) {
    const std::size_t count = std::min(kPiece, positions.size() - first);
    ensure_size(block.wave_positions, groups_of(count) * 3 * kGroup);
    ensure_size(block.wave_sigma, groups_of(count) * kGroup);
    for (std::size_t i = 0; i < count; ++i) set_position(block.wave_positions.data(), i, positions[first + i]);
    pad_positions(block.wave_positions, count);
    field_.density(block.wave_positions.data(), groups_of(count), block.marched, 0, block.wave_sigma.data());
    std::copy_n(block.wave_sigma.begin(), count, sigma.begin() + std::ptrdiff_t(first));
  }
}

void LuminanceEngineCpu::query_luminance(std::span<const Vec3f> positions, std::span<const Vec3f> directions,
                                         std::span<float> luminance) const {
  CNERF_CHECK_EQ(positions.size(), luminance.size());
  CNERF_CHECK_EQ(positions.size(), directions.size());
  constexpr std::size_t kPiece = 512;
  Block& block = blocks_.local();
  for (std::size_t first = 0; first < positions.size(); first += kPiece) {
    const std::size_t count = std::min(kPiece, positions.size() - first);
    ensure_size(block.positions, groups_of(count) * 3 * kGroup);
    block.work.resize(groups_of(count), field_.encoded_channels());
    for (std::size_t i = 0; i < groups_of(count) * kGroup; ++i) {
      const std::size_t from = first + std::min(i, count - 1);
      set_position(block.positions.data(), i, positions[from]);
      LuminanceFieldCpu::set_direction(block.work, i, directions[from]);
    }
    field_.forward(block.positions.data(), block.work);
    for (std::size_t i = 0; i < count; ++i) luminance[first + i] = field_.luminance(block.work, i);
  }
}

std::vector<StatePiece> LuminanceEngineCpu::state() {
  std::vector<StatePiece> state;
  field_.append_state(state);
  state.push_back(state_piece("occupancy", occupancy_.densities()));
  state.push_back(state_piece("counters", counters_));
  if (options_.learning.is_on()) {
    state.push_back(state_piece("views", corrections_));
    state.push_back(state_piece("views.moments", correction_moments_));
  }
  if (!lenses_.empty()) {
    state.push_back(state_piece("lenses", lenses_));
    state.push_back(state_piece("lenses.moments", lens_moments_));
  }
  return state;
}

void LuminanceEngineCpu::state_loaded() {
  field_.state_loaded();
  occupancy_.refresh_bits();
  use_lenses();
}

}  // namespace

std::unique_ptr<LuminanceEngine> make_cpu_luminance_engine(const LuminanceEngineOptions& options) {
  return std::make_unique<LuminanceEngineCpu>(options);
}

}  // namespace cnerf
