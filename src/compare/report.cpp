#include "src/compare/report.h"

#include <algorithm>

#include "src/base/files.h"
#include "src/base/json_record.h"
#include "src/capture/color_truth.h"
#include "src/compare/page.h"
#include "src/compare/seed_run.h"
#include "src/picture/contact_sheet.h"
#include "src/picture/encode.h"
#include "src/pipeline/picture_files.h"

namespace cnerf::compare {
namespace fs = std::filesystem;
namespace {

constexpr int kPictureWidth = 480;    // pixels
constexpr int kPictureQuality = 88;   // of JPEG
constexpr int kFramesPerSecond = 12;  // of a turntable
constexpr int kStripWidth = 168;      // pixels of a picture in a strip: a document shows four side by side
constexpr int kStripColumns = 4;

std::string jpeg_uri(const Picture& picture) {
  return data_uri("jpeg", jpeg_bytes(scaled_down(picture, kPictureWidth), kPictureQuality));
}

std::vector<std::string> uris_in(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code failure;
  for (const auto& entry : fs::directory_iterator(folder, failure)) files.push_back(entry.path());
  std::ranges::sort(files);
  std::vector<std::string> uris;
  for (const fs::path& file : files) uris.push_back(data_uri("jpeg", read_binary_file(file)));
  return uris;
}

ReportMethod exhibit(const Method& method, const Stage2Options& stage2, const fs::path& folder) {
  ReportMethod shown{method.name, uris_in(folder / "views"), uris_in(folder / "turntable"), {}};
  if (!method.is_colored || !stage2_of(method, stage2).purify.enabled) return shown;
  for (const auto& [name, title] : {std::pair{"bases.png", "base images"},
                                    {"accepted.png", "accepted answers"},
                                    {"rejected.png", "rejected answers"}}) {
    if (fs::exists(folder / name)) shown.galleries.push_back({title, data_uri("png", read_binary_file(folder / name))});
  }
  return shown;
}

Tile tile_of(int width, int height, const std::vector<float>& linear, std::string caption) {
  return {scaled_down(picture_from_linear(width, height, linear), kStripWidth), std::move(caption)};
}

}  // namespace

ReportCapture exhibit(const Subject& subject, std::span<const Method* const> methods, const Stage2Options& stage2,
                      const fs::path& cells) {
  ReportCapture report;
  report.name = subject.name;
  report.frames_per_second = kFramesPerSecond;
  for (const std::size_t index : subject.shown()) {
    const View& view = *subject.evaluated[index];
    report.views.push_back(view.name);
    report.inputs.push_back(jpeg_uri(pipeline::grey_picture(view.image)));
    const std::optional<ColorImage> truth = load_color_truth(view);
    if (truth) report.truths.push_back(jpeg_uri(picture_from_linear(truth->width, truth->height, truth->rgb)));
  }
  if (report.truths.size() != report.inputs.size()) report.truths.clear();
  for (const Method* method : methods) report.methods.push_back(exhibit(*method, stage2, cells / method->name));
  return report;
}

void write_strip(const Subject& subject, std::span<const Method* const> methods, const fs::path& cells,
                 const fs::path& file) {
  const View& view = *subject.evaluated[subject.shown().front()];
  std::vector<Tile> tiles;
  tiles.push_back(tile_of(view.image.width, view.image.height, luminance_plane(view.image), "input"));
  for (const Method* method : methods) {
    const fs::path picture = cells / method->name / "views" / numbered(0);
    if (!method->is_colored || !fs::exists(picture)) continue;
    const ColorImage image = load_color_image(picture);
    tiles.push_back(tile_of(image.width, image.height, image.rgb, method->name));
  }
  if (const auto truth = load_color_truth(view)) {
    tiles.push_back(tile_of(truth->width, truth->height, truth->rgb, "truth"));
  }
  write_png(file, tiled(tiles, kStripColumns));
}

std::string report_html(std::span<const Cell> cells, const Summary& summary, std::span<const ReportCapture> captures) {
  nlohmann::ordered_json data = {{"table", table_json(cells, summary)},
                                 {"methods", nlohmann::ordered_json::array()},
                                 {"captures", nlohmann::ordered_json::array()}};
  for (const Method& method : kMethods) {
    if (std::ranges::find(cells, std::string(method.name), &Cell::method) == cells.end()) continue;
    data["methods"].push_back({{"name", method.name}, {"summary", method.summary}});
  }
  for (const ReportCapture& capture : captures) data["captures"].push_back(json_of(capture));
  return page_with(kReportPage, data);
}

}  // namespace cnerf::compare
