#pragma once
/// The photographs of a capture in colour, as a step of a run.

#include <filesystem>
#include <string>
#include <vector>

#include "src/engine/engines.h"
#include "src/pipeline/run_context.h"

namespace cnerf::pipeline {

enum class PhotographFormat { kPng, kTiff };  ///< 16 bits each

/// "png" or "tiff".  @throws UsageError
[[nodiscard]] PhotographFormat photograph_format_named(const std::string& name);

struct PhotographsJob {
  std::string take;  ///< whose chroma they get
  std::vector<std::string>
      views;  ///< called as the capture does, or by their file with or without extension; empty = all
  std::filesystem::path folder;  ///< for the files, which are called as the photographs
  PhotographFormat format = PhotographFormat::kPng;
  std::filesystem::path capture = {};  ///< where it lies now; empty = where the run's record says
};

/// Where they go if nothing else is said.
[[nodiscard]] std::filesystem::path photographs_folder(const RunDirectory& directory, const std::string& take);

/// @throws UsageError  where no take is chosen: there is no chroma
void check_photographs_take(const RunDirectory& directory, const std::string& take);

/// Writes photographs at the full size of their files, held-out ones too: the lightness of the file, and chroma that
/// the take has at the photograph's camera. Learned exposures do not touch the lightness. Coverage stays. Where the
/// file has a note that turns it, the written one is turned.
/// @return  the files, in the order of the capture's views; each is whole or not there
/// @throws UsageError   no take, no such view
/// @throws InputError   a photograph that is not that of the context's capture any more
/// @throws Interrupted  between two photographs; those that were written stay
std::vector<std::filesystem::path> photographs_step(const RunContext& context, const PhotographsJob& job,
                                                    const Engines& engines, Observer& observer);

}  // namespace cnerf::pipeline
