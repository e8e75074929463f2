#pragma once
/// What texts of USD have in common.

#include <fmt/format.h>

#include <string>

#include "export/options.h"

namespace cnerf::exporting {

/// A USD string; what is quoted here are file names and names of colorizers.
[[nodiscard]] inline std::string usd_quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    result += c == '\n' ? ' ' : c;
  }
  return result + "\"";
}

/// The beginning of a file whose root is an Xform called cnerf; the caller closes its brace. USD knows Y and Z as up
/// axes: an X-up frame is turned by a transform of the root.
/// @param up_axis  of the file's world, "x", "y" or "z".
[[nodiscard]] inline std::string usd_beginning(const std::string& up_axis, const Label& label) {
  std::string text = fmt::format(
      "#usda 1.0\n(\n    defaultPrim = \"cnerf\"\n    doc = {}\n    metersPerUnit = {}\n    upAxis = \"{}\"\n)\n\n"
      "def Xform \"cnerf\"\n{{\n",
      usd_quoted(color_origin_text(label.provenance)), label.world.metres_per_unit, up_axis == "y" ? "Y" : "Z");
  if (up_axis == "x") {
    text += "    double3 xformOp:rotateXYZ = (0, -90, 0)\n    uniform token[] xformOpOrder = [\"xformOp:rotateXYZ\"]\n";
  }
  return text;
}

}  // namespace cnerf::exporting
