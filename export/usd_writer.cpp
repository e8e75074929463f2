#include "export/usd_writer.h"

#include <fmt/format.h>

#include "src/base/files.h"

namespace cnerf::exporting {
namespace {

struct Field {
  const char *name, *data_type, *role;
};
constexpr Field kFields[] = {{"density", "float", ""},
                             {"color", "float3", "Color"},
                             {"luminance", "float", ""},
                             {"lab_a", "float", ""},
                             {"lab_b", "float", ""}};

/// A USD string; what is quoted here are file names and names of colorizers.
std::string quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    result += c == '\n' ? ' ' : c;
  }
  return result + "\"";
}

std::string volume_prim(const ManifestVolume& volume, std::size_t number) {
  std::string text = fmt::format("    def Volume \"grid_{}\"\n    {{\n", number);
  Aabbd box = Aabbd::empty();  // of the file
  box.grow(volume.file_from_world.point(volume.bounds.min));
  box.grow(volume.file_from_world.point(volume.bounds.max));
  const Vec3d low = box.min, high = box.max;
  text += fmt::format("        float3[] extent = [({}, {}, {}), ({}, {}, {})]\n", low.x, low.y, low.z, high.x, high.y,
                      high.z);
  for (const Field& field : kFields) {
    text += fmt::format("        rel field:{0} = </cnerf/grid_{1}/{0}>\n", field.name, number);
  }
  for (const Field& field : kFields) {
    text += fmt::format(
        "\n        def OpenVDBAsset \"{0}\"\n        {{\n            token fieldClass = \"fogVolume\"\n"
        "            token fieldName = \"{0}\"\n            token fieldDataType = \"{1}\"\n",
        field.name, field.data_type);
    if (*field.role != 0) text += fmt::format("            token vectorDataRoleHint = \"{}\"\n", field.role);
    text += fmt::format("            asset filePath = @./{}@\n        }}\n", volume.file);
  }
  return text + "    }\n";
}

}  // namespace

void write_usd(const std::vector<ManifestVolume>& volumes, const std::string& up_axis, const Label& label,
               const std::filesystem::path& file) {
  const bool x_up = up_axis == "x";
  std::string text = fmt::format(
      "#usda 1.0\n(\n    defaultPrim = \"cnerf\"\n    doc = {}\n    metersPerUnit = {}\n    upAxis = \"{}\"\n)\n\n"
      "def Xform \"cnerf\"\n{{\n",
      quoted(color_origin_text(label.provenance)), label.world.metres_per_unit, up_axis == "y" ? "Y" : "Z");
  if (x_up) {
    text += "    double3 xformOp:rotateXYZ = (0, -90, 0)\n    uniform token[] xformOpOrder = [\"xformOp:rotateXYZ\"]\n";
  }
  for (std::size_t v = 0; v < volumes.size(); ++v) text += volume_prim(volumes[v], v);
  write_file(file, text + "}\n");
}

}  // namespace cnerf::exporting
