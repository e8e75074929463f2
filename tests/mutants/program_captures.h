#pragma once
/// Small captures with the cameras of other programs.

#include "tests/mutants/originals.h"

namespace cnerf::mutants {

/// One kind of file per program, each read by the steps.
/// @param folder  that the captures are made in
void add_program_captures(const std::filesystem::path& folder, const std::vector<Step>& steps,
                          std::vector<Kind>& kinds);

}  // namespace cnerf::mutants
