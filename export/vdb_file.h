#pragma once
/// Reads OpenVDB files with OpenVDB, in the process that calls: for vdb_reader_main.cpp alone, since the library does
/// not stand damaged files. Everybody else calls vdb_reader.h.

#include <filesystem>

#include "bake/volume.h"
#include "export/vdb_reader.h"

namespace cnerf::exporting {

/// @throws InputError  also for what is larger than vdb_answer.h allows.
[[nodiscard]] bake::Volume volume_in(const std::filesystem::path& path);
[[nodiscard]] VdbSummary summary_in(const std::filesystem::path& path);

}  // namespace cnerf::exporting
