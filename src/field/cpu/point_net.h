#pragma once
/// A hash grid and a small net over points, of which the colour fields of stage 2 consist.

#include <cstdint>
#include <string>
#include <vector>

#include "src/base/vec3.h"
#include "src/field/cpu/hash_grid.h"
#include "src/field/cpu/mlp.h"

namespace cnerf {

/// Buffers for a block of points; grouped arrays [G, C, 16].
struct PointWorkspace {
  std::size_t groups = 0;
  AlignedVector<float> positions, encoded, hidden, output;
  AlignedVector<float> d_hidden, d_output;
};

/// 4 L -> 64 -> outputs.
class PointNetCpu {
 public:
  /// @param relu_output  ReLU behind the output as well
  PointNetCpu(const HashGridOptions& grid, int outputs, bool relu_output, std::uint64_t seed);

  /// Makes room and sets the positions; lanes beyond `points.size()` are padded.
  void set_points(std::span<const Vec3f> points, PointWorkspace& work) const;
  /// Fills `work.output`.
  void forward(PointWorkspace& work) const;
  /// From `work.d_output`, given behind the output's ReLU if there is one.
  /// @param d_encoded  [G, 4 L, 16], written   @param d_weights  [weight_count], added to
  void backward(PointWorkspace& work, float* d_encoded, float* d_weights) const;
  /// See LuminanceFieldCpu::update.
  void update(const std::vector<EncodedSamples>& runs, const std::vector<float>& d_weights, float learning_rate,
              long step, const GradientSum& sum = {});

  [[nodiscard]] int encoded_channels() const { return grid_.channels(); }
  [[nodiscard]] std::size_t weight_count() const { return net_.layout().weight_count(); }
  void append_state(const std::string& prefix, std::vector<StatePiece>& state);
  void state_loaded() { net_.transpose_weights(); }

 private:
  [[nodiscard]] std::vector<Channels> activations(PointWorkspace& work) const;

  int outputs_;
  bool relu_output_;
  HashGridCpu grid_;
  MlpCpu net_;
};

}  // namespace cnerf
