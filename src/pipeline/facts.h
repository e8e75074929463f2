#pragma once
/// What things and machines are, as lines of a report.

#include <filesystem>
#include <string>
#include <vector>

#include "src/capture/load_capture.h"

namespace cnerf::pipeline {

struct Fact {
  std::string name, value;
};

/// What a capture, a folder of photographs, a run, a .snapshot or a .vdb holds; pictures are described by their
/// headers.
/// @param options  how a capture is read
/// @throws MissingInputError, InputError, SnapshotError
[[nodiscard]] std::vector<Fact> facts_of(const std::filesystem::path& what, const CaptureOptions& options);

/// What this build and this machine can do, and what is missing.
[[nodiscard]] std::vector<Fact> facts_of_machine();

}  // namespace cnerf::pipeline
