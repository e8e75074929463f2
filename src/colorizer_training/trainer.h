#pragma once
/// Trains the built-in colorizer.

#include <torch/torch.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "src/colorizer/torch/network.h"
#include "src/colorizer_training/batch.h"
#include "src/colorizer_training/feature_teacher.h"
#include "src/colorizer_training/flat_parameters.h"
#include "src/colorizer_training/losses.h"

namespace cnerf::colorizer_training {

struct TrainerOptions {
  int steps = 60000;
  int photos_per_step = 96, tiles_per_step = 56;
  std::vector<int> crop_sides = {128, 128, 128, 160, 160};  ///< one is drawn per step; multiples of 32
  double learning_rate = 1e-3;                              ///< at the start of the cosine
  int warmup_steps = 500;
  double regression_weight = 0.01;
  double distilled_share = 0.5;  ///< of the classification, where networks are distilled: the rest is the truth's
  int epoch_steps = 2000;        ///< between checkpoints, scores and pictures
  std::uint64_t seed = 1;
};

/// Networks that stay as they are and help to train another. Each may be null.
struct FrozenNetworks {
  ColorizerNet start{nullptr};              ///< whose weights the trained one begins with; folded
  std::unique_ptr<FeatureTeacher> teacher;  ///< whose features of the colour picture are predicted
  std::shared_ptr<const Encoder> encoder;   ///< beside the trained network, which is the large one then
  std::vector<ColorizerNet> distilled;      ///< whose answers, their mean, are learned besides the truth; folded
};

/// What one step cost, before weights.
struct StepLosses {
  torch::Tensor classification, distillation, regression, label, feature;  ///< scalars on the device, detached
};

/// The state of a training run. A step is a pure function of the state and its number, so a run continued from a
/// checkpoint repeats the uninterrupted one bit for bit on the CPU.
class ColorizerTrainer {
 public:
  /// @param images  must outlive the trainer
  ColorizerTrainer(const ImageSet& images, FrozenNetworks frozen, const TrainerOptions& options, torch::Device device);

  StepLosses step();
  [[nodiscard]] std::int64_t steps_done() const { return step_; }
  [[nodiscard]] std::int64_t total_steps() const { return options_.steps; }

  /// The averaged network, in evaluation mode, on the training device.
  [[nodiscard]] ColorizerNet& averaged() { return averaged_; }
  [[nodiscard]] const SoftLabelTable& table() const { return table_; }
  /// [313] f32 on the device: the class weights of the loss.
  [[nodiscard]] const torch::Tensor& class_weights() const { return class_weights_; }

  void save(const std::filesystem::path& checkpoint);
  /// Its number of steps takes the place of this one's.
  /// @param wanted_steps  that it has to have in all, where somebody asked for a number
  /// @throws MissingInputError, SnapshotError  a checkpoint of another network or run.
  /// @throws UsageError  it has another number of steps
  void load(const std::filesystem::path& checkpoint, std::optional<int> wanted_steps = {});

 private:
  [[nodiscard]] Batch batch_of(std::uint64_t seed, std::int64_t step) const;
  [[nodiscard]] double learning_rate() const;
  [[nodiscard]] torch::Tensor measure_class_weights() const;
  void average_weights();
  [[nodiscard]] std::vector<torch::Tensor> state();

  TrainerOptions options_;
  torch::Device device_;
  FrozenNetworks frozen_;
  ResidentImages photos_, tiles_;
  SoftLabelTable table_;
  LabelLoss label_loss_;
  ColorizerNet network_, averaged_;
  AuxiliaryHeads heads_;
  FlatParameters parameters_, averaged_parameters_;
  FlatAdamW optimizer_;
  torch::Tensor class_weights_;
  std::int64_t step_ = 0;
};

}  // namespace cnerf::colorizer_training
