#include "src/field/cpu/luminance_field.h"

#include <algorithm>
#include <type_traits>

#include "src/field/nets.h"

namespace cnerf {
namespace {

constexpr int kFeatureChannels = kGeometryChannels + kSphericalHarmonics;

/// Samples that lie side by side both where they come from and where they go to.
struct Run {
  std::size_t from, to, count;
};

/// @param lanes  where samples 0, 1, ... come from
std::vector<Run> runs_of(std::span<const std::uint32_t> lanes) {
  std::vector<Run> runs;
  for (std::size_t s = 0; s < lanes.size(); ++s) {
    const bool goes_on = s % kGroup != 0 && lanes[s] % kGroup != 0 && lanes[s] == lanes[s - 1] + 1;
    if (goes_on) {
      ++runs.back().count;
    } else {
      runs.push_back({lanes[s], s, 1});
    }
  }
  return runs;
}

/// The first `wanted` of the channels of two grouped arrays; lanes behind the last sample are zeroed.
void take(std::span<const Run> runs, const AlignedVector<float>& from, int channels, int wanted,
          AlignedVector<float>& to) {
  const std::size_t end = runs.empty() ? 0 : runs.back().to + runs.back().count;
  for (const Run& run : runs) {
    const float* source = &GroupedView<const float>(from, channels).at(run.from, 0);
    float* target = &GroupedView<float>(to, channels).at(run.to, 0);
    // Most are whole: eight samples of a ray, which a copy of fixed size moves at once.
    const auto copy = [&](auto count) {
      for (int c = 0; c < wanted; ++c) std::copy_n(source + c * kGroup, std::size_t(count), target + c * kGroup);
    };
    if (run.count == 8) {
      copy(std::integral_constant<std::size_t, 8>());
    } else {
      copy(run.count);
    }
  }
  for (std::size_t s = end; s < groups_of(end) * kGroup; ++s) {
    for (int c = 0; c < wanted; ++c) GroupedView<float>(to, channels).at(s, c) = 0;
  }
}

}  // namespace

void LuminanceWorkspace::resize(std::size_t wanted_groups, int encoded_channels) {
  groups = wanted_groups;
  const std::size_t lanes = groups * kGroup;
  ensure_size(d_log_density, lanes);
  ensure_size(encoded, lanes * std::size_t(encoded_channels));
  for (auto* buffer : {&hidden, &d_hidden}) ensure_size(*buffer, lanes * kHiddenWidth);
  for (auto* buffer : {&features, &d_features}) ensure_size(*buffer, lanes * kFeatureChannels);
  for (auto* buffer : {&luminance_hidden, &d_luminance_hidden}) ensure_size(*buffer, lanes * 2 * kHiddenWidth);
  for (auto* buffer : {&raw_luminance, &d_raw_luminance}) ensure_size(*buffer, lanes * kLuminanceOutputs);
}

LuminanceFieldCpu::LuminanceFieldCpu(const HashGridOptions& grid, float density_scale, float max_luminance,
                                     std::uint64_t seed)
    : grid_(grid, seed),
      density_net_(density_net_layout(grid_.channels() / 4), seed, kDensityNetStream),
      luminance_net_(luminance_net_layout(), seed, kLuminanceNetStream),
      density_scale_(density_scale),
      luminance_activation_(LuminanceActivation<float>::up_to(max_luminance)) {}

std::vector<Channels> LuminanceFieldCpu::density_layers(DensityWorkspace& work, std::size_t first) const {
  const auto at = [first](AlignedVector<float>& values, int channels) {
    return Channels{values.data() + first * std::size_t(channels) * kGroup, channels};
  };
  return {at(work.encoded, grid_.channels()), at(work.hidden, kHiddenWidth), at(work.features, kFeatureChannels)};
}

std::vector<Channels> LuminanceFieldCpu::luminance_layers(LuminanceWorkspace& work) {
  return {{work.features.data(), kFeatureChannels},
          {work.luminance_hidden.data(), 2 * kHiddenWidth},
          {work.luminance_hidden.data() + kHiddenWidth * kGroup, 2 * kHiddenWidth},
          {work.raw_luminance.data(), kLuminanceOutputs}};
}

void LuminanceFieldCpu::density(const float* positions, std::size_t groups, DensityWorkspace& work, std::size_t first,
                                float* sigma) const {
  const std::size_t lanes = (first + groups) * kGroup;
  ensure_size(work.encoded, lanes * std::size_t(grid_.channels()));
  ensure_size(work.hidden, lanes * kHiddenWidth);
  ensure_size(work.features, lanes * kFeatureChannels);
  const std::vector<Channels> layers = density_layers(work, first);
  grid_.encode(positions, groups, layers.front().data);
  density_net_.forward(layers, groups);
  for (std::size_t s = 0; s < groups * kGroup; ++s) sigma[s] = this->sigma(work, first * kGroup + s);
}

void LuminanceFieldCpu::set_direction(LuminanceWorkspace& work, std::size_t sample, Vec3f direction) {
  const GroupedView<float> features(work.features, kFeatureChannels);
  spherical_harmonics(direction.x, direction.y, direction.z,
                      [&](int i, float value) { features.at(sample, kGeometryChannels + i) = value; });
}

void LuminanceFieldCpu::forward(const float* positions, LuminanceWorkspace& work) const {
  grid_.encode(positions, work.groups, work.encoded.data());
  density_net_.forward(density_layers(work), work.groups);
  luminance_net_.forward(luminance_layers(work), work.groups);
}

void LuminanceFieldCpu::forward(const DensityWorkspace& from, std::span<const std::uint32_t> lanes, bool for_backward,
                                LuminanceWorkspace& work) const {
  const std::vector<Run> runs = runs_of(lanes);
  take(runs, from.features, kFeatureChannels, kGeometryChannels, work.features);
  if (for_backward) {
    take(runs, from.encoded, grid_.channels(), grid_.channels(), work.encoded);
    take(runs, from.hidden, kHiddenWidth, kHiddenWidth, work.hidden);
  }
  luminance_net_.forward(luminance_layers(work), work.groups);
}

float LuminanceFieldCpu::sigma(const DensityWorkspace& work, std::size_t sample) const {
  return density_from_raw(GroupedView<const float>(work.features, kFeatureChannels).at(sample, 0), density_scale_);
}

float LuminanceFieldCpu::luminance(const LuminanceWorkspace& work, std::size_t sample) const {
  return luminance_activation_.value(GroupedView<const float>(work.raw_luminance, kLuminanceOutputs).at(sample, 0));
}

void LuminanceFieldCpu::set_gradient(LuminanceWorkspace& work, std::size_t sample, float d_sigma,
                                     float d_luminance) const {
  const float raw_luminance = GroupedView<const float>(work.raw_luminance, kLuminanceOutputs).at(sample, 0);
  const GroupedView<float> d_raw(work.d_raw_luminance, kLuminanceOutputs);
  d_raw.at(sample, 0) = d_luminance * luminance_activation_.derivative(raw_luminance);
  for (int pad = 1; pad < kLuminanceOutputs; ++pad) d_raw.at(sample, pad) = 0;
  work.d_log_density[sample] = d_sigma * sigma(work, sample);
}

void LuminanceFieldCpu::backward(LuminanceWorkspace& work, float* d_encoded, float* d_weights) const {
  luminance_net_.backward(luminance_layers(work),
                          {{work.d_features.data(), kFeatureChannels},
                           {work.d_luminance_hidden.data(), 2 * kHiddenWidth},
                           {work.d_luminance_hidden.data() + kHiddenWidth * kGroup, 2 * kHiddenWidth},
                           {work.d_raw_luminance.data(), kLuminanceOutputs}},
                          work.groups, d_weights + density_net_.layout().weight_count());
  const GroupedView<float> d_features(work.d_features, kFeatureChannels);
  for (std::size_t s = 0; s < work.groups * kGroup; ++s) d_features.at(s, 0) += work.d_log_density[s];
  density_net_.backward(
      density_layers(work),
      {{d_encoded, grid_.channels()}, {work.d_hidden.data(), kHiddenWidth}, {work.d_features.data(), kFeatureChannels}},
      work.groups, d_weights);
}

void LuminanceFieldCpu::update(const std::vector<EncodedSamples>& runs, const std::vector<float>& d_weights,
                               float learning_rate, long step, const GradientSum& sum) {
  const AdamStep adam(learning_rate, step);
  grid_.backward_and_update(runs, adam, sum);
  const std::size_t split = density_net_.layout().weight_count();
  density_net_.update({d_weights.begin(), d_weights.begin() + std::ptrdiff_t(split)}, adam);
  luminance_net_.update({d_weights.begin() + std::ptrdiff_t(split), d_weights.end()}, adam);
}

void LuminanceFieldCpu::append_state(std::vector<StatePiece>& state) {
  grid_.append_state("grid", state);
  density_net_.append_state("density_net", state);
  luminance_net_.append_state("luminance_net", state);
}

void LuminanceFieldCpu::state_loaded() {
  density_net_.transpose_weights();
  luminance_net_.transpose_weights();
}

}  // namespace cnerf
