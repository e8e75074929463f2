#include "src/train/chroma/color_model.h"

#include <algorithm>
#include <cmath>

#include "src/base/check.h"
#include "src/base/parallel.h"
#include "src/picture/picture.h"
#include "src/train/luminance/options_json.h"
#include "src/train/luminance/stored_grid.h"

namespace cnerf {
namespace {

constexpr const char* kKind = "take";

constexpr const char* kFieldColors = "field";

/// Takes of earlier versions say it by an option.
PixelColors pixel_colors_of(const nlohmann::json& header) {
  const bool is_field =
      header.value("pixel_colors", "") == kFieldColors || header.at("options").value("injection", "") == "photometric";
  return is_field ? PixelColors::kField : PixelColors::kDistribution;
}

/// Colours as they can be shown at the pixels' light.
/// @param seen  RayResult of a pixel
template <typename Seen>
void show(std::vector<Ab>& colors, const Seen& seen) {
  parallel_each(colors.size(), 256, [&](std::size_t p) {
    const RayResult pixel = seen(p);
    colors[p] = pixel.opacity >= kLeastColoredOpacity ? in_gamut(colors[p], pixel.luminance) : Ab{};
  });
}

/// Of the size that the snapshot says, still to be restored.
SkyColors stored_sky(const Snapshot& snapshot) {
  constexpr int kWidest = 4096;
  const int width = snapshot.header().contains("sky_width") ? header_field<int>(snapshot, "sky_width") : 0;
  if (width == 0) return {};
  if (width < 2 || width > kWidest || (width & (width - 1)) != 0) {
    throw SnapshotError(snapshot.file().string() + ": header: sky_width: expected a power of two up to 4096");
  }
  return SkyColors(width);
}

}  // namespace

Ab in_gamut(Ab color, float luminance) {
  return ab_of_linear_rgb(linear_rgb_at(luminance, color));
}

std::vector<float> pixel_luminance(const PixelSamples& pixels) {
  std::vector<float> luminance(pixels.pixels(), 0.0f);
  parallel_each(pixels.pixels(), 256, [&](std::size_t p) {
    for (std::size_t s = pixels.offsets[p]; s < pixels.offsets[p + 1]; ++s) {
      luminance[p] += pixels.weights[s] * pixels.luminance[s];
    }
  });
  return luminance;
}

ColorModel ColorModel::create(const Stage2Options& options, const Engines& engines) {
  ColorModel model;
  model.options = options;
  model.kernels = kernels_of(engines);
  const auto seed = std::uint64_t(options.seed);
  model.chroma = engines.make_color_bins(options.grid, seed ^ named_stream("chr"));
  model.chromaticity = engines.make_color_field(options.grid, seed ^ named_stream("xyz"));
  return model;
}

std::vector<StatePiece> ColorModel::state() {
  std::vector<StatePiece> pieces = chroma->state();
  for (StatePiece& piece : chromaticity->state()) pieces.push_back(std::move(piece));
  pieces.push_back(state_piece("queries", queries));
  if (sky.exists()) pieces.push_back(state_piece("sky", sky.sums()));
  return pieces;
}

ColorModel ColorModel::load(const std::filesystem::path& file, const Engines& engines) {
  const Snapshot snapshot(file, kKind);
  ColorModel model;
  try {
    const auto options = options_from_json<Stage2Options>(snapshot.header().at("options"));
    check_stored_grid(snapshot, options.grid);
    model = create(options, engines);
    model.kernels_before = snapshot.header().value("kernels", "");
    model.pixel_colors = pixel_colors_of(snapshot.header());
    const nlohmann::json& report = snapshot.header().at("report");
    SnapshotTimes times = load_times(file);
    model.report = {
        0, 0, times["seconds"], times["colorizer_seconds"], times["waited_seconds"], report.at("bake_ab_distance")};
    read_exactly(report.at("accepted"), model.report.accepted);
    read_exactly(report.at("rejected"), model.report.rejected);
  } catch (const nlohmann::json::exception& problem) {
    throw SnapshotError(file.string() + ": header: " + problem.what());
  }
  model.colorizer = header_field<std::string>(snapshot, "colorizer");
  model.stage1_sha256 = header_field<std::string>(snapshot, "stage1_sha256");
  model.sky = stored_sky(snapshot);
  snapshot.restore(model.state());
  model.sky.refresh();
  model.chroma->state_loaded();
  model.chromaticity->state_loaded();
  return model;
}

void ColorModel::save(const std::filesystem::path& file) {
  save_snapshot(
      file, kKind,
      {{"options", options_to_json(options)},
       {"pixel_colors", pixel_colors == PixelColors::kField ? kFieldColors : "distribution"},
       {"kernels", kernels},
       {"colorizer", colorizer},
       {"stage1_sha256", stage1_sha256},
       {"sky_width", sky.width()},
       {"report",
        {{"accepted", report.accepted}, {"rejected", report.rejected}, {"bake_ab_distance", report.bake_ab_distance}}}},
      state());
  save_times(file, {{"seconds", report.seconds},
                    {"colorizer_seconds", report.colorizer_seconds},
                    {"waited_seconds", report.waited_seconds}});
}

ColorModel ColorModel::copy(const Engines& engines) {
  ColorModel same = create(options, engines);
  same.pixel_colors = pixel_colors;
  same.colorizer = colorizer;
  same.stage1_sha256 = stage1_sha256;
  same.report = report;
  same.sky = sky;
  const std::vector<StatePiece> from = state(), to = same.state();
  CNERF_CHECK(from.size() == to.size(), "models of the same options have the same pieces");
  for (std::size_t i = 0; i < from.size(); ++i) {
    CNERF_CHECK(from[i].bytes.size() == to[i].bytes.size(), "pieces of the same size");
    std::ranges::copy(from[i].bytes, to[i].bytes.begin());
  }
  same.chroma->state_loaded();
  same.chromaticity->state_loaded();
  return same;
}

std::vector<Ab> ColorModel::decode(const PixelSamples& pixels) const {
  std::vector<Ab> colors(pixels.pixels());
  if (pixel_colors == PixelColors::kField) {
    chromaticity->composite(pixels, colors);
  } else {
    chroma->decode(pixels, float(options.decode_temperature), colors);
  }
  const std::vector<float> luminance = pixel_luminance(pixels);
  show(colors, [&](std::size_t p) { return RayResult{luminance[p], pixels.opacity(p), 0}; });
  return colors;
}

std::vector<Ab> ColorModel::decode(const TracedPixels& pixels) const {
  std::vector<Ab> colors(pixels.results().size());
  if (pixel_colors == PixelColors::kField) {
    chromaticity->composite(pixels.samples(), colors);
  } else {
    chroma->decode_traced(pixels, float(options.decode_temperature), colors);
  }
  show(colors, [&](std::size_t p) { return pixels.results()[p]; });
  return colors;
}

}  // namespace cnerf
