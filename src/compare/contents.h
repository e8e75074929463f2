#pragma once
/// What the files hold that a comparison is made with: other content under the same name makes other cells.

#include <filesystem>
#include <string>

#include "src/colorizer/colorizer_options.h"

namespace cnerf::compare {

/// Tells what a file, or the files of a folder in the order of their names, hold from other content; empty where there
/// is neither, which who reads it says.
[[nodiscard]] std::string content_of(const std::filesystem::path& place);

/// The same of the files that a colorizer's spec names, and of the contracts beside them.
/// @param folder  where they are looked up, before they are looked up as given
[[nodiscard]] std::string content_of_spec(const ColorizerOptions& options, const std::filesystem::path& folder);

/// The same of the built-in network's weights.
[[nodiscard]] std::string content_of_builtin();

}  // namespace cnerf::compare
