#include "src/colorizer_training/trainer.h"

#include <ATen/autocast_mode.h>
#include <torch/version.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/rng.h"
#include "src/color/ab_bins.h"

namespace cnerf::colorizer_training {
namespace fs = std::filesystem;
using torch::Tensor;

namespace {

constexpr int kPriorBatches = 100;
constexpr float kRebalancing = 0.5f;                           // lambda of the class weights
constexpr double kFinalShare = 0.01;                           // of the learning rate, at the end of the cosine
constexpr double kAverageDecay = 0.999;                        // of the weights that are kept, per step
constexpr std::uint64_t kCropStream = named_stream("crop");    // the size of each step's crops
constexpr std::uint64_t kPriorStream = named_stream("prior");  // batches that only measure

/// bf16 for matrix products and convolutions on CUDA while it lives; weights and losses stay f32.
class MixedPrecision {
 public:
  explicit MixedPrecision(torch::Device device) : active_(device.is_cuda()) { set(active_); }
  ~MixedPrecision() {
    set(false);
    if (active_) at::autocast::clear_cache();
  }
  MixedPrecision(const MixedPrecision&) = delete;
  MixedPrecision& operator=(const MixedPrecision&) = delete;

 private:
  static void set(bool on) {
#if TORCH_VERSION_MAJOR >= 2
    at::autocast::set_autocast_dtype(at::kCUDA, at::kBFloat16);
    at::autocast::set_autocast_enabled(at::kCUDA, on);
#else
    at::autocast::set_autocast_gpu_dtype(at::kBFloat16);
    at::autocast::set_enabled(on);
#endif
  }
  bool active_;
};

ColorizerNet make_network(const FrozenNetworks& frozen, std::uint64_t seed, torch::Device device) {
  torch::manual_seed(std::int64_t(seed));
  // A copy of the start goes on without batch normalisation: its statistics are no longer known.
  ColorizerNet network =
      frozen.start ? fold_batch_norm(frozen.start) : ColorizerNet(Normalisation::kBatch, frozen.encoder);
  network->to(device);
  return network;
}

AuxiliaryHeads make_heads(const ImageSet& images, bool teacher, torch::Device device) {
  AuxiliaryHeads heads(std::int64_t(images.classes.names.size()), teacher ? FeatureTeacher::kChannels : 1);
  heads->to(device);
  return heads;
}

}  // namespace

ColorizerTrainer::ColorizerTrainer(const ImageSet& images, FrozenNetworks frozen, const TrainerOptions& options,
                                   torch::Device device)
    : options_(options),
      device_(device),
      frozen_(std::move(frozen)),
      photos_(images.photos, device),
      tiles_(images.tiles, device),
      table_(device),
      label_loss_(images.classes, device),
      network_(make_network(frozen_, options.seed, device)),
      averaged_(make_network(frozen_, options.seed, device)),
      heads_(make_heads(images, frozen_.teacher != nullptr, device)),
      parameters_({network_.get(), heads_.get()}),
      averaged_parameters_({averaged_.get()}),
      optimizer_(parameters_) {
  if (images.photos.size() == 0) options_.photos_per_step = 0;
  if (images.tiles.size() == 0) options_.tiles_per_step = 0;
  CNERF_CHECK(options_.photos_per_step + options_.tiles_per_step > 0, "there are images to train on");
  averaged_->eval();
  for (ColorizerNet& network : frozen_.distilled) {
    network->to(device);
    network->eval();
  }
  class_weights_ = measure_class_weights();
}

Batch ColorizerTrainer::batch_of(std::uint64_t seed, std::int64_t step) const {
  const CounterRng rng(seed ^ kCropStream, std::uint64_t(step));
  const int side = options_.crop_sides.at(rng.below(1, std::uint32_t(options_.crop_sides.size())));
  return make_batch({{&photos_, options_.photos_per_step}, {&tiles_, options_.tiles_per_step}}, side, seed, step);
}

Tensor ColorizerTrainer::measure_class_weights() const {
  std::vector<Tensor> samples;
  for (int i = 0; i < kPriorBatches; ++i) samples.push_back(batch_of(options_.seed ^ kPriorStream, i).ab);
  const Tensor prior = measure_prior(samples, table_).contiguous();
  const std::vector<float> weights =
      rebalancing_weights(std::span(prior.data_ptr<float>(), std::size_t(kAbBinCount)), kRebalancing);
  return torch::tensor(weights).to(device_);
}

double ColorizerTrainer::learning_rate() const {
  const double warm = std::min(1.0, double(step_ + 1) / options_.warmup_steps);
  const double done = std::min(1.0, double(step_) / options_.steps);
  const double cosine = 0.5 * (1 + std::cos(std::numbers::pi * done));
  return options_.learning_rate * warm * (kFinalShare + (1 - kFinalShare) * cosine);
}

StepLosses ColorizerTrainer::step() {
  network_->train();
  heads_->train();
  // Also seeds the generators that dropout draws from.
  const Batch batch = batch_of(options_.seed, step_);
  ColorizerFeatures features;
  std::vector<Tensor> taught;
  Tensor labels, predicted, teacher;
  {
    const MixedPrecision mixed(device_);
    for (ColorizerNet& network : frozen_.distilled) {
      const torch::NoGradGuard no_grad;
      taught.push_back(network->forward(batch.lightness));
    }
    features = network_->features(batch.lightness);
    labels = heads_->classify(features.global);
    if (frozen_.teacher) {
      predicted = heads_->predict_features(features.semantic);
      teacher = frozen_.teacher->features(batch.rgb, predicted.size(2), predicted.size(3));
    }
  }
  const ColorLoss color = color_loss(features.logits, batch.ab, table_, class_weights_);
  const Tensor label = (1 - batch.mixed_share) * label_loss_(labels, batch.label) +
                       batch.mixed_share * label_loss_(labels, batch.mixed_label);
  const Tensor none = torch::zeros({}, batch.ab.options());
  const Tensor feature = teacher.defined() ? feature_loss(predicted, teacher) : none;
  const Tensor distillation = taught.empty() ? none : distillation_loss(features.logits, taught);
  const double distilled = taught.empty() ? 0 : options_.distilled_share;
  const Tensor total = (1 - distilled) * color.classification + distilled * distillation +
                       options_.regression_weight * color.regression + label + feature;
  total.backward();
  optimizer_.step(learning_rate(), step_ + 1);
  average_weights();
  ++step_;
  return {color.classification.detach(), distillation.detach(), color.regression.detach(), label.detach(),
          feature.detach()};
}

void ColorizerTrainer::average_weights() {
  const torch::NoGradGuard no_grad;
  // Starts short, so that the first weights are soon forgotten.
  const double decay = std::min(kAverageDecay, double(1 + step_) / double(10 + step_));
  Tensor& average = averaged_parameters_.values;
  average.lerp_(parameters_.values.narrow(0, 0, average.numel()), 1 - decay);
  averaged_parameters_.buffers.lerp_(parameters_.buffers, 1 - decay);
}

std::vector<Tensor> ColorizerTrainer::state() {
  return {parameters_.values,          parameters_.buffers,          optimizer_.first_moment, optimizer_.second_moment,
          averaged_parameters_.values, averaged_parameters_.buffers, class_weights_};
}

void ColorizerTrainer::save(const fs::path& checkpoint) {
  std::vector<Tensor> tensors;
  for (const Tensor& tensor : state()) tensors.push_back(tensor.cpu());
  tensors.push_back(torch::tensor({step_, std::int64_t(options_.steps)}, torch::kInt64));
  write_atomically(checkpoint, [&](const fs::path& temporary) { torch::save(tensors, temporary.string()); });
}

void ColorizerTrainer::load(const fs::path& checkpoint, std::optional<int> wanted_steps) {
  if (!fs::exists(checkpoint)) throw MissingInputError(checkpoint.string() + ": no such checkpoint");
  const torch::NoGradGuard no_grad;
  std::vector<Tensor> tensors;
  try {
    torch::load(tensors, checkpoint.string(), torch::kCPU);
  } catch (const c10::Error& error) {
    throw SnapshotError(checkpoint.string() + ": not a checkpoint, or cut short: " + error.what_without_backtrace());
  }
  std::vector<Tensor> own = state();
  bool fits = tensors.size() == own.size() + 1;
  for (std::size_t i = 0; fits && i < own.size(); ++i) fits = tensors[i].sizes() == own[i].sizes();
  if (!fits) throw SnapshotError(checkpoint.string() + ": a checkpoint of another network or other classes");
  const int steps = int(tensors.back()[1].item<std::int64_t>());  // where the cosine ends
  if (wanted_steps && *wanted_steps != steps) {
    throw UsageError("--steps " + std::to_string(*wanted_steps) + ": " + checkpoint.string() + " is of a training of " +
                     std::to_string(steps) + " steps; give that number, or start again without --resume");
  }
  for (std::size_t i = 0; i < own.size(); ++i) own[i].copy_(tensors[i]);
  step_ = tensors.back()[0].item<std::int64_t>();
  options_.steps = steps;
}

}  // namespace cnerf::colorizer_training
