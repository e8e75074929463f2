#include "export/usd_text.h"

#include <fmt/format.h>

namespace cnerf::exporting {

std::string usd_quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    result += c == '\n' ? ' ' : c;
  }
  return result + "\"";
}

std::string usd_begin(const std::string& up_axis, const Label& label, const std::string& times) {
  std::string text = fmt::format(
      "#usda 1.0\n(\n    defaultPrim = \"cnerf\"\n    doc = {}\n    metersPerUnit = {}\n    upAxis = \"{}\"\n{})\n\n"
      "def Xform \"cnerf\"\n{{\n",
      usd_quoted(color_origin_text(label.provenance)), label.world.metres_per_unit, up_axis == "y" ? "Y" : "Z", times);
  if (up_axis == "x") {
    text += "    double3 xformOp:rotateXYZ = (0, -90, 0)\n    uniform token[] xformOpOrder = [\"xformOp:rotateXYZ\"]\n";
  }
  return text;
}

}  // namespace cnerf::exporting
