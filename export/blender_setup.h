#pragma once
/// The Python script that shows a bake in Blender as it was trained.

#include <filesystem>
#include <string>

namespace cnerf::exporting {

/// Text of export/blender_setup.py.
[[nodiscard]] const std::string& blender_setup_text();

/// Writes `blender_setup.py` into the folder of a bake, beside its manifest.json, and returns its path. The script
/// knows that folder, so that it also works pasted into Blender's text editor.
/// @throws OutputError.
std::filesystem::path write_blender_setup(const std::filesystem::path& folder);

}  // namespace cnerf::exporting
