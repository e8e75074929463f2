#pragma once
/// Parts of USD scenes as text.

#include <string>

#include "export/options.h"

namespace cnerf::exporting {

/// A USD string; what is quoted are file names and names of colorizers.
[[nodiscard]] std::string usd_quoted(const std::string& text);

/// The head of a .usda and the beginning of its root prim, `/cnerf`, which `}` ends. USD knows Y and Z as up axes: an
/// X-up frame is turned by a transform of the root.
/// @param up_axis  of the file, "x", "y" or "z"
/// @param times    further lines of the head, indented
[[nodiscard]] std::string usd_begin(const std::string& up_axis, const Label& label, const std::string& times = {});

}  // namespace cnerf::exporting
