/// Trains, colours and bakes a capture:  pipeline_example CAPTURE RUN
#include <cstdio>

#include "src/base/error.h"
#include "src/pipeline/bake_step.h"
#include "src/pipeline/colorize_step.h"
#include "src/pipeline/train_step.h"

namespace pipeline = cnerf::pipeline;

class Printer : public cnerf::Observer {
  void say(const std::string& text) override { std::puts(text.c_str()); }
  void wrote(const std::string& what, const std::filesystem::path& path) override {
    std::printf("%s: %s\n", what.c_str(), path.c_str());
  }
};

int main(int argc, char** argv) {
  if (argc != 3) return 64;
  try {
    Printer printer;
    const cnerf::Engines& engines = cnerf::engines_for("auto");
    cnerf::Config config;
    config.stage1.steps = 60;  // as many as show that it runs
    config.stage1.samples_per_step = 4096;
    config.colorizer.spec = "grey";
    config.stage2.patches = 6;
    config.stage2.distill_steps = 10;
    config.bake.resolution = 32;
    const pipeline::RunContext run = {
        pipeline::RunDirectory(argv[2]), config, pipeline::read_capture(argv[1], config, printer), {argv, argv + argc}};
    pipeline::begin_run(run, argv[1], {});
    pipeline::train_step(run, {}, engines, printer);
    pipeline::colorize_step(run, {"example", {}, nullptr}, engines, printer);
    pipeline::bake_step(run, {"example", run.directory.bakes("example"), {.vdb = true}}, engines, printer);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
