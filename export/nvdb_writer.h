#pragma once
/// Baked voxels -> NanoVDB, as renderers on graphics cards read it.

#include <filesystem>

#include "export/vdb_writer.h"

namespace cnerf::exporting {

/// Writes the grids of write_vdb, with the same names, transform and active voxels, in 32 bits and not compressed: what
/// every reader of NanoVDB knows. The format has no place for text, so the manifest alone says where the colours come
/// from. The file is whole or not there.
/// @throws ContractError, OutputError  as write_vdb.
void write_nvdb(const bake::VolumePlanes& volume, const std::filesystem::path& path, const VdbOptions& options = {},
                const Label& label = {});

}  // namespace cnerf::exporting
