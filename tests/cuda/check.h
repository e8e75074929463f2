#pragma once
/// The parts of cnerf-cuda-check: one executable of benchmarks that needs nothing but a driver.

#include <map>
#include <string>
#include <vector>

#include "src/engine/luminance_engine.h"

namespace cnerf::test {

/// `key=value` arguments.
class Arguments {
 public:
  Arguments(int argc, char** argv, int first) {
    for (int i = first; i < argc; ++i) {
      const std::string argument = argv[i];
      const std::size_t equals = argument.find('=');
      values_[argument.substr(0, equals)] = equals == std::string::npos ? "1" : argument.substr(equals + 1);
    }
  }
  [[nodiscard]] double number(const std::string& key, double otherwise) const {
    const auto found = values_.find(key);
    return found == values_.end() ? otherwise : std::stod(found->second);
  }
  [[nodiscard]] std::string text(const std::string& key, const std::string& otherwise) const {
    const auto found = values_.find(key);
    return found == values_.end() ? otherwise : found->second;
  }

 private:
  std::map<std::string, std::string> values_;
};

/// Engine options from arguments: levels, log2_rows, coarsest, finest, samples, steps_per_box, cone_angle, seed.
[[nodiscard]] LuminanceEngineOptions engine_options(const Arguments& arguments, int cascades);

/// Waits until every step is done.
void wait_for(const LuminanceEngine& engine);

/// Times steps and pictures on a packed capture after some training.
int bench(const Arguments& arguments);
/// Times stage 2 on a packed capture: caching its views, steps of both engines on either device, colours of pixels.
int bench_stage2(const Arguments& arguments);
/// Trains on a packed capture; prints the held-out PSNR at growing training times.
int train(const Arguments& arguments);

}  // namespace cnerf::test
