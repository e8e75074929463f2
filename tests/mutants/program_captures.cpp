#include "tests/mutants/program_captures.h"

#include <fmt/format.h>

#include <functional>

#include "src/base/files.h"
#include "tests/capture/fixtures.h"

namespace cnerf::mutants {
namespace {
namespace fs = std::filesystem;

constexpr int kViews = 4, kWidth = 24, kHeight = 16;
constexpr double kFocal = 20, kBetween = 0.3;  // cameras side by side that look the same way

/// A text for each view, one after another.
std::string for_views(const std::function<std::string(int)>& text) {
  std::string all;
  for (int i = 0; i < kViews; ++i) all += text(i);
  return all;
}

void write_images(const fs::path& folder) {
  for (int i = 0; i < kViews; ++i) {
    test::write_grey_image(folder / fmt::format("{}.png", i), kWidth, kHeight);
  }
}

std::string metashape() {
  const std::string cameras = for_views([](int i) {
    return fmt::format(
        "<camera id=\"{0}\" sensor_id=\"0\" component_id=\"0\" label=\"{0}.png\">"
        "<transform>1 0 0 {1} 0 1 0 0 0 0 1 0 0 0 0 1</transform></camera>\n",
        i, i * kBetween);
  });
  return fmt::format(
      "<?xml version=\"1.0\"?>\n<document version=\"1.5.0\"><chunk label=\"c\"><sensors><sensor id=\"0\" "
      "type=\"frame\"><calibration type=\"frame\" class=\"adjusted\"><resolution width=\"{}\" height=\"{}\"/>"
      "<f>{}</f><cx>0.1</cx><cy>0.2</cy><k1>0.01</k1></calibration></sensor></sensors><components><component "
      "id=\"0\"><transform><rotation>1 0 0 0 1 0 0 0 1</rotation><translation>0 0 1</translation><scale>1.5</scale>"
      "</transform></component></components><cameras>\n{}</cameras></chunk></document>\n",
      kWidth, kHeight, kFocal, cameras);
}

std::string realitycapture() {
  return "#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\n" +
         for_views([](int i) { return fmt::format("{}.png,{},0,2,0,0,0,30,0,0,0.01,0,0,0,0,0\n", i, i * kBetween); });
}

std::string sidecar(int i) {
  return fmt::format(
      "<x:xmpmeta xmlns:x=\"adobe:ns:meta/\"><rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\">"
      "<rdf:Description xcr:FocalLength35mm=\"30\" xcr:DistortionModel=\"brown3\" "
      "xmlns:xcr=\"http://www.capturingreality.com/ns/xcr/1.1#\"><xcr:Rotation>1 0 0 0 1 0 0 0 1</xcr:Rotation>"
      "<xcr:Position>{} 0 0</xcr:Position><xcr:DistortionCoeficients>0.01 0 0 0 0 0</xcr:DistortionCoeficients>"
      "</rdf:Description></rdf:RDF></x:xmpmeta>\n",
      i * kBetween);
}

nlohmann::json polycam(int i) {
  nlohmann::json camera = {{"width", kWidth}, {"height", kHeight},  {"fx", kFocal},
                           {"fy", kFocal},    {"cx", kWidth / 2.0}, {"cy", kHeight / 2.0}};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) camera[fmt::format("t_{}{}", row, column)] = row == column ? 1.0 : 0.0;
    camera[fmt::format("t_{}3", row)] = row == 0 ? i * kBetween : 0.0;
  }
  return camera;
}

nlohmann::json record3d() {
  nlohmann::json poses = nlohmann::json::array(), lenses = nlohmann::json::array();
  for (int i = 0; i < kViews; ++i) {
    poses.push_back({0, 0, 0, 1, i * kBetween, 0, 0});
    lenses.push_back({kFocal, kFocal, kWidth / 2.0, kHeight / 2.0});
  }
  return {{"w", kWidth},
          {"h", kHeight},
          {"K", {kFocal, 0, 0, 0, kFocal, 0, kWidth / 2.0, kHeight / 2.0, 1}},
          {"poses", poses},
          {"perFrameIntrinsicCoeffs", lenses}};
}

}  // namespace

void add_program_captures(const fs::path& folder, const std::vector<Step>& steps, std::vector<Kind>& kinds) {
  const auto add = [&](const char* name, const char* capture, const char* file) {
    kinds.push_back({name, folder / capture, file, true, Format::kPlain, steps});
  };
  write_images(folder / "metashape/images");
  write_file(folder / "metashape/cameras.xml", metashape());
  add("cameras.xml (Metashape)", "metashape", "cameras.xml");
  write_images(folder / "table");
  write_file(folder / "table/cameras.csv", realitycapture());
  add("table (RealityCapture)", "table", "cameras.csv");
  write_images(folder / "sidecars");
  for (int i = 0; i < kViews; ++i) write_file(folder / fmt::format("sidecars/{}.xmp", i), sidecar(i));
  add("sidecar (RealityCapture)", "sidecars", "1.xmp");
  write_images(folder / "polycam/keyframes/images");
  for (int i = 0; i < kViews; ++i) {
    test::write_json(folder / fmt::format("polycam/keyframes/cameras/{}.json", i), polycam(i));
  }
  add("camera (Polycam)", "polycam", "keyframes/cameras/1.json");
  write_images(folder / "record3d/rgb");
  test::write_json(folder / "record3d/metadata.json", record3d());
  add("metadata.json (Record3D)", "record3d", "metadata.json");
}

}  // namespace cnerf::mutants
