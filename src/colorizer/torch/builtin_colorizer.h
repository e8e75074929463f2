#pragma once
/// The colorizer that needs no download: a small network whose weights come with the program.

#include <filesystem>
#include <memory>

#include "src/colorizer/colorizer.h"

namespace cnerf {

/// Where the program's own weights lie: $CNERF_COLORIZER_WEIGHTS, beside the installed program in
/// `../share/cnerf/`, or in the source tree it was built from.
/// @throws MissingInputError  naming the places it looked at.
[[nodiscard]] std::filesystem::path builtin_weights_file();

/// A batch of 8 patches of 128x128 is one pass; larger batches are split. Runs on CUDA where LibTorch has it, else on
/// the CPU. Answers ab by the decoding stored with the weights; the same input gives the same answer.
/// @throws MissingInputError, InputError  see load_colorizer_weights.
[[nodiscard]] std::unique_ptr<Colorizer> load_builtin_colorizer(const std::filesystem::path& weights);

}  // namespace cnerf
