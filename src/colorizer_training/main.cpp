/// cnerf-train-colorizer: trains, judges and exports the built-in colorizer.

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <iostream>
#include <optional>
#include <sstream>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/progress.h"
#include "src/color/ab_bins.h"
#include "src/colorizer/torch/encoder.h"
#include "src/colorizer/torch/network_weights.h"
#include "src/colorizer_training/report.h"
#include "src/colorizer_training/trainer.h"

namespace cnerf::colorizer_training {
namespace {

namespace fs = std::filesystem;

struct Options {
  ImageSources sources;
  fs::path teacher, output = "colorizer-training";
  fs::path evaluate;                ///< weights to judge
  fs::path finish;                  ///< weights of a run to choose the decoding of
  fs::path start;                   ///< weights to begin with
  std::vector<fs::path> distilled;  ///< weights of networks whose answers are learned
  bool is_large = false;
  std::string device = "auto";
  bool resume = false;
  TrainerOptions training;
  bool names_steps = false;  ///< the user does
};

torch::Device choose_device(const std::string& name) {
  if (name == "cpu") return torch::kCPU;
  if (torch::cuda::is_available()) return torch::kCUDA;
  if (name == "cuda") throw DeviceError("--device cuda: LibTorch sees no CUDA device");
  return torch::kCPU;
}

void add_options(CLI::App& app, Options& o) {
  app.add_option("--photos", o.sources.photos, "folders of set/class/name images; class - means unknown");
  app.add_option("--mosaics", o.sources.mosaics, "folders of mosaics of equal square tiles");
  app.add_option("--mosaic-labels", o.sources.mosaic_labels, ".npy of uint8, one label per tile");
  app.add_option("--tile", o.sources.tile_side, "side of a mosaic's tiles, pixels")->check(CLI::Range(8, 1024));
  app.add_option("--held-out", o.sources.held_out, "twentieths of every set that are not trained on")
      ->check(CLI::Range(1, kHeldOutParts - 1));
  app.add_option("--evaluation", o.sources.evaluation, "folders that are never trained on, only judged");
  app.add_option("--teacher", o.teacher, "LPIPS SqueezeNet weights: predict a classifier's features of the colours");
  CLI::Option* large =
      app.add_flag("--large", o.is_large, "the network that also sees what the installed encoder makes of a picture");
  app.add_option("--from", o.start, "weights to begin with, of a network of either kind")->excludes(large);
  CLI::Option* distill = app.add_option("--distill", o.distilled,
                                        "latest.weights of runs, whose mean answer is learned besides the truth");
  app.add_option("--distilled-share", o.training.distilled_share,
                 "their share of the classification loss; the rest is the truth's")
      ->check(CLI::Range(0.0, 1.0))
      ->needs(distill);
  app.add_option("-o,--output", o.output, "folder for checkpoint, pictures, scores and weights");
  app.add_option("--evaluate", o.evaluate, "only write the score table of these weights");
  app.add_option("--finish", o.finish, "only choose the decoding of a run's latest.weights; class-weights.txt beside");
  app.add_option("--device", o.device, "auto, cpu or cuda")->check(CLI::IsMember({"auto", "cpu", "cuda"}));
  app.add_flag("--resume", o.resume, "continue from the checkpoint in the output folder");
  TrainerOptions& t = o.training;
  app.add_option("--steps", t.steps, "training steps")->check(CLI::PositiveNumber);
  app.add_option("--epoch-steps", t.epoch_steps, "steps between checkpoints, scores and pictures")
      ->check(CLI::PositiveNumber);
  app.add_option("--photos-per-step", t.photos_per_step, "photographs in a batch");
  app.add_option("--tiles-per-step", t.tiles_per_step, "mosaic tiles in a batch");
  app.add_option("--learning-rate", t.learning_rate, "at the start of the cosine");
  app.add_option("--regression-weight", t.regression_weight, "of the smooth L1 on the expected ab");
  app.add_option("--seed", t.seed, "of weights and batches");
}

void print_progress(const ColorizerTrainer& trainer, const StepLosses& losses, std::int64_t first_step,
                    std::chrono::steady_clock::time_point start) {
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const double rate = double(trainer.steps_done() - first_step) / seconds;
  const double left = double(trainer.total_steps() - trainer.steps_done()) / rate;
  std::printf("step %lld/%lld class %.4f distilled %.4f regression %.3f label %.3f feature %.3f | ",
              static_cast<long long>(trainer.steps_done()), static_cast<long long>(trainer.total_steps()),
              losses.classification.item<double>(), losses.distillation.item<double>(),
              losses.regression.item<double>(), losses.label.item<double>(), losses.feature.item<double>());
  std::printf("%.1f steps/s, %d:%02d left\n", rate, int(left) / 60, int(left) % 60);
  std::fflush(stdout);
}

void end_epoch(ColorizerTrainer& trainer, const ImageSet& images, const Options& o, torch::Device device) {
  // Images to judge come in many sizes: trying algorithms for each would take longer than judging.
  at::globalContext().setBenchmarkCuDNN(false);
  trainer.save(o.output / "checkpoint.pt");
  const torch::Tensor weights = trainer.class_weights().cpu().contiguous();
  std::string class_weights;
  for (const float weight :
       std::vector<float>(weights.data_ptr<float>(), weights.data_ptr<float>() + weights.numel())) {
    class_weights += std::to_string(weight) + "\n";
  }
  write_file(o.output / "class-weights.txt", class_weights);
  save_colorizer_weights(o.output / "latest.weights", fold_batch_norm(trainer.averaged()), {});
  const std::string line = validation_line(trainer.averaged(), images.validation, trainer.table());
  std::printf("step %lld validation: %s\n", static_cast<long long>(trainer.steps_done()), line.c_str());
  std::fflush(stdout);
  write_sample_sheet(o.output / "validation.png", trainer.averaged(), {}, images.validation, 2, device);
  at::globalContext().setBenchmarkCuDNN(true);
}

void run_steps(ColorizerTrainer& trainer, const ImageSet& images, const Options& o, torch::Device device) {
  constexpr int kReportSteps = 500;
  at::globalContext().setBenchmarkCuDNN(true);
  const auto start = std::chrono::steady_clock::now();
  const std::int64_t first_step = trainer.steps_done();
  while (trainer.steps_done() < trainer.total_steps()) {
    const StepLosses losses = trainer.step();
    const std::int64_t done = trainer.steps_done();
    if (done % kReportSteps == 0 || done - first_step == 20) print_progress(trainer, losses, first_step, start);
    if (done % o.training.epoch_steps == 0 || done == trainer.total_steps()) end_epoch(trainer, images, o, device);
    if (interruption_requested()) {
      trainer.save(o.output / "checkpoint.pt");
      throw Interrupted("saved " + (o.output / "checkpoint.pt").string() + "; continue with --resume");
    }
  }
}

/// Chooses the decoding on the validation images, writes the weights and the scores of what was written.
/// @param log_weights  [313] log of the class weights the network was trained with, on the CPU.
void export_weights(ColorizerNet folded, const torch::Tensor& log_weights, const ImageSet& images, const Options& o,
                    torch::Device device) {
  at::globalContext().setBenchmarkCuDNN(false);
  const SoftLabelTable table(device);
  folded->to(device);
  const DecodingChoice choice = choose_decoding(folded, images.validation, log_weights.to(device), table);
  folded->shift_logits(-choice.prior_share * log_weights);
  save_colorizer_weights(o.output / "colorizer.weights", folded, choice.decoding);

  ColorizerWeights written = load_colorizer_weights(o.output / "colorizer.weights");
  written.network->to(device);
  const std::string text = score_table(score_sets(written.network, written.decoding, images, table));
  std::printf("short side %d, prior share %.2f, temperature %.2f, gain %.2f\n%s", choice.decoding.short_side,
              choice.prior_share, choice.decoding.temperature, choice.decoding.gain, text.c_str());
  write_file(o.output / "scores.md", text);
}

torch::Tensor read_log_class_weights(const fs::path& file) {
  std::istringstream text(read_text_file(file));
  std::vector<float> weights;
  for (float weight = 0; text >> weight;) weights.push_back(weight);
  if (weights.size() != std::size_t(kAbBinCount)) throw InputError(file, "class weights", "expected 313 numbers");
  return torch::tensor(weights).log();
}

void finish(const Options& o, torch::Device device) {
  const fs::path class_weights = o.finish.parent_path() / "class-weights.txt";
  export_weights(load_colorizer_weights(o.finish).network, read_log_class_weights(class_weights),
                 load_image_set(o.sources), o, device);
}

void train(const Options& o, torch::Device device) {
  FrozenNetworks frozen;
  if (!o.teacher.empty()) frozen.teacher = std::make_unique<FeatureTeacher>(o.teacher, device);
  if (o.is_large) frozen.encoder = installed_encoder("--large");
  if (!o.start.empty()) frozen.start = load_colorizer_weights(o.start).network;
  for (const fs::path& file : o.distilled) frozen.distilled.push_back(load_colorizer_weights(file).network);
  const ImageSet images = load_image_set(o.sources);
  std::printf("%zu photographs, %zu tiles, %zu classes\n", images.photos.size(), images.tiles.size(),
              images.classes.names.size());
  ColorizerTrainer trainer(images, std::move(frozen), o.training, device);
  std::printf("%lld parameters\n", static_cast<long long>(parameter_count(*trainer.averaged())));
  if (o.resume) {
    trainer.load(o.output / "checkpoint.pt", o.names_steps ? std::optional(o.training.steps) : std::nullopt);
  }
  run_steps(trainer, images, o, device);
  export_weights(fold_batch_norm(trainer.averaged()), trainer.class_weights().log().cpu(), images, o, device);
}

void evaluate(const Options& o, torch::Device device) {
  ColorizerWeights weights = load_colorizer_weights(o.evaluate);
  weights.network->to(device);
  const ImageSet images = load_image_set(o.sources);
  const SoftLabelTable table(device);
  const std::string text = score_table(score_sets(weights.network, weights.decoding, images, table));
  std::printf("%sA patch of 128x128 in a batch of 8: %.2f ms\n", text.c_str(),
              patch_milliseconds(weights.network, weights.decoding, device));
  write_file(o.output / "scores.md", text);
  EvaluationSets sets = images.validation;
  sets.insert(images.evaluation.begin(), images.evaluation.end());
  write_sample_sheet(o.output / "samples.png", weights.network, weights.decoding, sets, 6, device);
}

int run(int argc, char** argv) {
  Options options;
  CLI::App app("Trains and judges the built-in colorizer.");
  add_options(app, options);
  CLI11_PARSE(app, argc, argv);
  options.names_steps = app.count("--steps") > 0;
  install_interruption_handler();
  const torch::Device device = choose_device(options.device);
  at::globalContext().setAllowTF32CuDNN(true);
  at::globalContext().setAllowTF32CuBLAS(true);
  if (!options.finish.empty()) {
    finish(options, device);
  } else if (!options.evaluate.empty()) {
    evaluate(options, device);
  } else {
    train(options, device);
  }
  return 0;
}

}  // namespace
}  // namespace cnerf::colorizer_training

int main(int argc, char** argv) {
  try {
    return cnerf::colorizer_training::run(argc, argv);
  } catch (const cnerf::Error& error) {
    std::cerr << "cnerf-train-colorizer: " << error.what() << '\n';
    return int(error.exit_code());
  } catch (const std::exception& error) {
    std::cerr << "cnerf-train-colorizer: internal error: " << error.what() << '\n';
    return int(cnerf::ExitCode::kInternal);
  }
}
