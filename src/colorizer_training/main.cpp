/// cnerf-train-colorizer: trains, judges and exports the built-in colorizer.

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <sstream>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/progress.h"
#include "src/color/ab_bins.h"
#include "src/colorizer/torch/network_weights.h"
#include "src/colorizer_training/report.h"
#include "src/colorizer_training/trainer.h"

namespace cnerf {
namespace {

namespace fs = std::filesystem;

struct Options {
  ImageSources sources;
  std::vector<fs::path> evaluation;  ///< tars that are only judged on
  fs::path teacher, output = "colorizer-training", evaluate;
  std::vector<fs::path> average;  ///< weights of one run to average
  std::vector<fs::path> distil;   ///< weights of other runs to learn from
  std::string device = "auto";
  bool resume = false, photo_labels = true;
  double minutes = 0;  ///< training time; 0 = as many steps as asked for
  TrainerOptions training;
};

torch::Device choose_device(const std::string& name) {
  if (name == "cpu") return torch::kCPU;
  if (torch::cuda::is_available()) return torch::kCUDA;
  if (name == "cuda") throw DeviceError("--device cuda: LibTorch sees no CUDA device");
  return torch::kCPU;
}

/// A side the network takes.
std::string check_crop_side(const std::string& text) {
  constexpr int kMultiple = ColorizerNetImpl::kInputMultiple;
  int side = 0;
  const bool good = CLI::detail::lexical_cast(text, side) && side > 0 && side % kMultiple == 0;
  return good ? "" : text + " is no multiple of " + std::to_string(kMultiple);
}

void add_options(CLI::App& app, Options& o) {
  app.add_option("--photos", o.sources.photos, "tars or folders of set/class/name images; class - means unknown");
  app.add_option("--mosaics", o.sources.mosaics, "tars or folders of mosaics of equal square tiles");
  app.add_option("--mosaic-labels", o.sources.mosaic_labels, ".npy of uint8, one label a tile");
  app.add_option("--tile", o.sources.tile_side, "side of a mosaic's tiles, pixels")->check(CLI::Range(8, 1024));
  app.add_flag("--balance-sets", o.sources.balance_sets, "draw large photo sets less often, as the root of their size");
  app.add_option("--evaluation", o.evaluation, "tars or folders that are never trained on, only judged");
  app.add_option("--distil", o.distil, "latest.weights of other runs: learn their mean answer besides the truth");
  app.add_option("--teacher", o.teacher, "LPIPS SqueezeNet weights: predict a classifier's features of the colours");
  app.add_option("-o,--output", o.output, "folder for checkpoint, pictures, scores and weights");
  app.add_option("--evaluate", o.evaluate, "only write the score table of these weights");
  app.add_option("--average", o.average,
                 "export the mean of these latest.weights of one run; class-weights.txt beside");
  app.add_option("--device", o.device, "auto, cpu or cuda")->check(CLI::IsMember({"auto", "cpu", "cuda"}));
  app.add_flag("--resume", o.resume, "continue from the checkpoint in the output folder");
  TrainerOptions& t = o.training;
  app.add_option("--steps", t.steps, "training steps")->check(CLI::PositiveNumber);
  app.add_option("--minutes", o.minutes, "train this long: the steps follow from the speed of the first 600");
  app.add_option("--epoch-steps", t.epoch_steps, "steps between checkpoints, scores and pictures")
      ->check(CLI::PositiveNumber);
  app.add_option("--held-out", o.sources.held_out, "twentieths of every set that are not trained on")
      ->check(CLI::Range(1, kHeldOutParts - 1));
  app.add_option("--crop-sides", t.crop_sides, "one a step; multiples of 32, pixels")->check(check_crop_side);
  app.add_option("--tile-share", t.tile_share, "of the steps, with tiles alone; 0 = some of both in every step")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--tile-crop-side", t.tile_crop_side, "of steps with tiles alone; a multiple of 32, pixels")
      ->check(check_crop_side);
  app.add_option("--patch-share", t.augment.patch_share, "of crops that look like a scene's patches, s in 0.3..0.7")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--whole-scale-min", t.augment.whole_scale_min, "least side of the other crops, of the short side")
      ->check(CLI::Range(0.05, 1.0));
  app.add_option("--photo-labels", o.photo_labels, "0 = classes of tiles alone");
  app.add_option("--photos-per-step", t.photos_per_step, "photographs in a batch");
  app.add_option("--tiles-per-step", t.tiles_per_step, "mosaic tiles in a batch");
  app.add_option("--learning-rate", t.learning_rate, "at the start of the cosine");
  app.add_option("--weight-decay", t.adamw.weight_decay, "decoupled");
  app.add_option("--rebalancing", t.rebalancing, "lambda of the class rebalancing")->check(CLI::Range(0.0, 1.0));
  app.add_option("--regression-weight", t.regression_weight, "of the smooth L1 on the expected ab");
  app.add_option("--label-weight", t.label_weight, "of the auxiliary class loss");
  app.add_option("--feature-weight", t.feature_weight, "of the auxiliary feature loss");
  app.add_option("--distillation-share", t.distillation_share, "of the classification loss, with --distil")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--average-decay", t.average_decay, "of the averaged weights, a step");
  app.add_option("--cutmix", t.augment.cutmix, "share of batches");
  app.add_option_function<double>(
         "--tone", [&t](double factor) { t.augment.tone_strength = t.tile_augment.tone_strength = factor; },
         "factor on the changes of lightness: gamma, contrast, shift")
      ->check(CLI::Range(0.0, 2.0));
  app.add_option_function<double>(
         "--wear", [&t](double factor) { t.augment.wear_strength = t.tile_augment.wear_strength = factor; },
         "factor on how many crops are blurred or noisy")
      ->check(CLI::Range(0.0, 1.6));
  app.add_option("--seed", t.seed, "of weights and batches");
}

constexpr int kWarmSteps = 200, kMeasuredSteps = 600;  // algorithms are tried during the first ones

void print_progress(const ColorizerTrainer& trainer, const StepLosses& losses, std::int64_t first_step,
                    std::chrono::steady_clock::time_point start) {
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const double rate = double(trainer.steps_done() - first_step) / seconds;
  const double left = double(trainer.total_steps() - trainer.steps_done()) / rate;
  std::printf("step %lld/%lld class %.4f regression %.3f label %.3f feature %.3f | %.1f steps/s, %d:%02d left\n",
              static_cast<long long>(trainer.steps_done()), static_cast<long long>(trainer.total_steps()),
              losses.classification.item<double>(), losses.regression.item<double>(), losses.label.item<double>(),
              losses.feature.item<double>(), rate, int(left) / 60, int(left) % 60);
  std::fflush(stdout);
}

void end_epoch(ColorizerTrainer& trainer, const ImageSet& images, const Options& o, torch::Device device) {
  // Images to judge come in many sizes: trying algorithms for each would take longer than judging.
  at::globalContext().setBenchmarkCuDNN(false);
  trainer.save(o.output / "checkpoint.pt");
  trainer.measure_statistics();
  const torch::Tensor weights = trainer.class_weights().cpu().contiguous();
  std::string class_weights;
  for (const float weight :
       std::vector<float>(weights.data_ptr<float>(), weights.data_ptr<float>() + weights.numel())) {
    class_weights += std::to_string(weight) + "\n";
  }
  write_file(o.output / "class-weights.txt", class_weights);
  save_colorizer_weights(o.output / "latest.weights", fold_batch_norm(trainer.averaged()), {});
  const std::string line = validation_line(trainer.averaged(), images.validation, trainer.table(), device);
  std::printf("step %lld validation: %s\n", static_cast<long long>(trainer.steps_done()), line.c_str());
  std::fflush(stdout);
  write_sample_sheet(o.output / "validation.png", trainer.averaged(), {}, images.validation, 2, device);
  at::globalContext().setBenchmarkCuDNN(true);
}

/// Once the speed is known, the number of steps that fits into the time asked for.
void fit_steps_to_minutes(ColorizerTrainer& trainer, double minutes, double seconds_so_far, std::int64_t first_step) {
  const double rate = double(trainer.steps_done() - first_step - kWarmSteps) / seconds_so_far;
  const double left = 60 * minutes - seconds_so_far;
  trainer.set_total_steps(trainer.steps_done() + std::int64_t(std::max(0.0, left) * rate));
  std::printf("%.1f steps/s: %lld steps in %.1f minutes\n", rate, static_cast<long long>(trainer.total_steps()),
              minutes);
}

void run_steps(ColorizerTrainer& trainer, const ImageSet& images, const Options& o, torch::Device device) {
  constexpr int kReportSteps = 500;
  at::globalContext().setBenchmarkCuDNN(true);
  auto start = std::chrono::steady_clock::now();
  const std::int64_t first_step = trainer.steps_done();
  while (trainer.steps_done() < trainer.total_steps()) {
    const StepLosses losses = trainer.step();
    const std::int64_t done = trainer.steps_done(), here = done - first_step;
    if (here == kWarmSteps && o.minutes > 0) start = std::chrono::steady_clock::now();
    if (here == kMeasuredSteps && o.minutes > 0 && !o.resume) {
      (void)losses.classification.item<double>();  // waits for the device
      const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
      fit_steps_to_minutes(trainer, o.minutes, seconds.count(), first_step);
    }
    if (done % kReportSteps == 0 || here == 20) print_progress(trainer, losses, first_step, start);
    if (done % o.training.epoch_steps == 0 || done == trainer.total_steps()) end_epoch(trainer, images, o, device);
    if (interruption_requested()) {
      trainer.save(o.output / "checkpoint.pt");
      throw Interrupted("saved " + (o.output / "checkpoint.pt").string() + "; continue with --resume");
    }
  }
}

EvaluationSets all_sets(const ImageSet& images, const Options& o) {
  EvaluationSets sets = images.validation;
  for (const fs::path& path : o.evaluation) sets["~" + path.stem().string()] = load_evaluation_images(path);
  return sets;
}

std::string full_table(ColorizerNet& network, const AbDecoding& decoding, const ImageSet& images, const Options& o,
                       const SoftLabelTable& table, torch::Device device) {
  std::vector<SetScore> scores = score_sets(network, decoding, images.validation, table, device);
  for (const fs::path& path : o.evaluation) {
    const EvaluationSets one = {{path.stem().string(), load_evaluation_images(path)}};
    for (SetScore& score : score_sets(network, decoding, one, table, device)) scores.push_back(std::move(score));
  }
  return score_table(scores);
}

/// Chooses the decoding on the validation images, writes the weights and the scores of what was written.
/// @param log_weights  [313] log of the class weights the network was trained with, on the CPU.
void export_weights(ColorizerNet folded, const torch::Tensor& log_weights, const ImageSet& images, const Options& o,
                    torch::Device device) {
  at::globalContext().setBenchmarkCuDNN(false);
  const SoftLabelTable table(device);
  folded->to(device);
  const DecodingChoice choice = choose_decoding(folded, images.validation, log_weights.to(device), table, device);
  folded->shift_logits(-choice.prior_share * log_weights);
  save_colorizer_weights(o.output / "colorizer.weights", folded, choice.decoding);

  ColorizerWeights written = load_colorizer_weights(o.output / "colorizer.weights");
  written.network->to(device);
  const std::string text = full_table(written.network, written.decoding, images, o, table, device);
  std::printf("short side %d, prior share %.2f, temperature %.2f, gain %.2f\n%s", choice.decoding.short_side,
              choice.prior_share, choice.decoding.temperature, choice.decoding.gain, text.c_str());
  write_file(o.output / "scores.md", text);
}

/// The mean of the weights of one run at several times (Izmailov et al. 2018), all written by end_epoch.
ColorizerNet averaged_network(const std::vector<fs::path>& files) {
  const torch::NoGradGuard no_grad;
  ColorizerNet mean = load_colorizer_weights(files.at(0)).network;
  auto sums = mean->parameters();
  for (std::size_t i = 1; i < files.size(); ++i) {
    const auto others = load_colorizer_weights(files[i]).network->parameters();
    for (std::size_t k = 0; k < sums.size(); ++k) sums[k].lerp_(others[k], 1.0 / double(i + 1));
  }
  return mean;
}

torch::Tensor read_log_class_weights(const fs::path& file) {
  std::istringstream text(read_text_file(file));
  std::vector<float> weights;
  for (float weight = 0; text >> weight;) weights.push_back(weight);
  if (weights.size() != std::size_t(kAbBinCount)) throw InputError(file, "class weights", "expected 313 numbers");
  return torch::tensor(weights).log();
}

void average(const Options& o, torch::Device device) {
  const fs::path class_weights = o.average.at(0).parent_path() / "class-weights.txt";
  export_weights(averaged_network(o.average), read_log_class_weights(class_weights), load_image_set(o.sources), o,
                 device);
}

void train(const Options& o, torch::Device device) {
  ImageSet images = load_image_set(o.sources);
  if (!o.photo_labels) images.photos.label.assign(images.photos.size(), -1);
  std::printf("%zu photographs, %zu tiles, %zu classes\n", images.photos.size(), images.tiles.size(),
              images.classes.names.size());
  std::unique_ptr<FeatureTeacher> teacher;
  if (!o.teacher.empty()) teacher = std::make_unique<FeatureTeacher>(o.teacher, device);
  ColorizerTrainer trainer(images, std::move(teacher), Ensemble(o.distil, device), o.training, device);
  std::printf("%lld parameters\n", static_cast<long long>(parameter_count(*trainer.averaged())));
  if (o.resume) trainer.load(o.output / "checkpoint.pt");
  run_steps(trainer, images, o, device);
  export_weights(fold_batch_norm(trainer.averaged()), trainer.class_weights().log().cpu(), images, o, device);
}

void evaluate(const Options& o, torch::Device device) {
  ColorizerWeights weights = load_colorizer_weights(o.evaluate);
  weights.network->to(device);
  const ImageSet images = load_image_set(o.sources);
  const SoftLabelTable table(device);
  const std::string text = full_table(weights.network, weights.decoding, images, o, table, device);
  std::printf("%sA patch of 128x128 in a batch of 8: %.2f ms\n", text.c_str(),
              patch_milliseconds(weights.network, weights.decoding, device));
  write_file(o.output / "scores.md", text);
  write_sample_sheet(o.output / "samples.png", weights.network, weights.decoding, all_sets(images, o), 6, device);
}

int run(int argc, char** argv) {
  Options options;
  CLI::App app("Trains and judges the built-in colorizer.");
  add_options(app, options);
  CLI11_PARSE(app, argc, argv);
  install_interruption_handler();
  const torch::Device device = choose_device(options.device);
  at::globalContext().setAllowTF32CuDNN(true);
  at::globalContext().setAllowTF32CuBLAS(true);
  if (!options.average.empty()) {
    average(options, device);
  } else if (!options.evaluate.empty()) {
    evaluate(options, device);
  } else {
    train(options, device);
  }
  return 0;
}

}  // namespace
}  // namespace cnerf

int main(int argc, char** argv) {
  try {
    return cnerf::run(argc, argv);
  } catch (const cnerf::Error& error) {
    std::cerr << "cnerf-train-colorizer: " << error.what() << '\n';
    return int(error.exit_code());
  } catch (const std::exception& error) {
    std::cerr << "cnerf-train-colorizer: internal error: " << error.what() << '\n';
    return int(cnerf::ExitCode::kInternal);
  }
}
