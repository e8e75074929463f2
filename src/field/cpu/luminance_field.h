#pragma once
/// Stage 1's field on the CPU: hash grid + density net -> density and geometry feature; feature and spherical harmonics
/// of the direction -> luminance net (paper, Eq. monochromenerf, with the hash grid in place of positional encoding).

#include <cstdint>
#include <span>
#include <vector>

#include "encoding/spherical_harmonics_math.h"
#include "src/base/vec3.h"
#include "src/field/cpu/hash_grid.h"
#include "src/field/cpu/mlp.h"
#include "src/field/luminance_activation.h"

namespace cnerf {

/// What the density net makes of samples; grouped arrays [G, C, 16].
struct DensityWorkspace {
  AlignedVector<float> encoded, hidden, features;
};

/// Buffers for a block of samples.
struct LuminanceWorkspace : DensityWorkspace {
  std::size_t groups = 0;
  AlignedVector<float> luminance_hidden, raw_luminance;
  AlignedVector<float> d_log_density;  ///< [16 G]
  AlignedVector<float> d_hidden, d_features, d_luminance_hidden, d_raw_luminance;

  void resize(std::size_t wanted_groups, int encoded_channels);
};

class LuminanceFieldCpu {
 public:
  LuminanceFieldCpu(const HashGridOptions& grid, float density_scale, float max_luminance, std::uint64_t seed);

  /// Density only.  @param positions [G, 3, 16]  @param first  group of `work` that the first one goes to
  /// @param sigma  [16 G]
  void density(const float* positions, std::size_t groups, DensityWorkspace& work, std::size_t first,
               float* sigma) const;

  /// Writes the encoded direction of one sample; to be called for all samples before `forward`.
  static void set_direction(LuminanceWorkspace& work, std::size_t sample, Vec3f direction);
  /// Fills the activations in `work`.
  void forward(const float* positions, LuminanceWorkspace& work) const;
  /// The same for samples whose density is known, without computing it again.
  /// @param lanes         of the samples in `from`
  /// @param for_backward  takes over what `backward` wants, too
  void forward(const DensityWorkspace& from, std::span<const std::uint32_t> lanes, bool for_backward,
               LuminanceWorkspace& work) const;
  [[nodiscard]] float sigma(const DensityWorkspace& work, std::size_t sample) const;
  [[nodiscard]] float luminance(const LuminanceWorkspace& work, std::size_t sample) const;

  /// Sets the gradient of the loss by one sample's sigma and luminance; to be called for all samples before `backward`.
  void set_gradient(LuminanceWorkspace& work, std::size_t sample, float d_sigma, float d_luminance) const;
  /// @param d_encoded  [G, channels, 16], written
  /// @param d_weights  [weight_count], added to: the density net's weights, then the luminance net's
  void backward(LuminanceWorkspace& work, float* d_encoded, float* d_weights) const;

  /// The gradient by the samples' positions, after `backward`, through the coarsest levels alone.
  /// @param d_positions  [G, 3, 16], written
  void position_gradient(int levels, const float* positions, const float* d_encoded, std::size_t groups,
                         float* d_positions) const {
    grid_.position_gradient(levels, positions, d_encoded, groups, d_positions);
  }
  [[nodiscard]] const std::vector<GridLevel>& levels() const { return grid_.levels(); }

  /// @param sum        over processes, of the table's gradient
  /// @param d_weights  summed already
  void update(const std::vector<EncodedSamples>& runs, const std::vector<float>& d_weights, float learning_rate,
              long step, const GradientSum& sum = {});

  [[nodiscard]] std::size_t weight_count() const {
    return density_net_.layout().weight_count() + luminance_net_.layout().weight_count();
  }
  [[nodiscard]] int encoded_channels() const { return grid_.channels(); }
  void append_state(std::vector<StatePiece>& state);
  void state_loaded();

 private:
  /// Arrays of the nets' layers, input first.
  [[nodiscard]] std::vector<Channels> density_layers(DensityWorkspace& work, std::size_t first = 0) const;
  [[nodiscard]] static std::vector<Channels> luminance_layers(LuminanceWorkspace& work);

  HashGridCpu grid_;
  MlpCpu density_net_;    ///< 4 L -> 64 -> 16
  MlpCpu luminance_net_;  ///< 16 + 16 -> 64 -> 64 -> 1 (padded to 4)
  float density_scale_;
  LuminanceActivation<float> luminance_activation_;
};

}  // namespace cnerf
