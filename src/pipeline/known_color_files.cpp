#include "src/pipeline/known_color_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/text.h"
#include "src/capture/image_io.h"
#include "src/color/ab_bins.h"
#include "src/pipeline/palette.h"
#include "src/prepare/photographs.h"
#include "src/train/chroma/strokes.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;
namespace {

constexpr float kStrokeAlpha = 0.5f;      // of a hint image: what is painted on
constexpr double kHintRadius = 0.01;      // of a hint's dot, as a share of the short side
constexpr float kLeastMeanChroma = 1.0f;  // a key frame of less is grey

const View& training_view(const Capture& capture, const std::string& name, const std::string& entry) {
  const View& view = capture.views[view_called(capture, name, entry)];
  if (view.held_out) {
    throw UsageError(entry + ": " + view.name + " is held out for evaluation; name a view that is trained on");
  }
  return view;
}

struct NamedFile {
  std::string view, entry;
  fs::path file;
};

/// "NAME=FILE;NAME=FILE"
std::vector<NamedFile> named_files(const std::string& list, const char* option) {
  std::vector<NamedFile> files;
  for (const std::string& item : split(list, ';')) {
    const auto equals = item.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == item.size()) {
      throw UsageError(fmt::format("{} {}: expected VIEW=FILE", option, item));
    }
    files.push_back({item.substr(0, equals), fmt::format("{} {}", option, item), item.substr(equals + 1)});
  }
  return files;
}

/// The orientation that turns back what stands upright.
int turning_back(int orientation) {
  return orientation == 6 ? 8 : orientation == 8 ? 6 : orientation;
}

/// Pixels as the view's file has them: `prepare` turns photographs upright, and other captures hold them as they are
/// stored.
LinearImage picture_of_view(const fs::path& file, const View& view) {
  LinearImage image = read_linear_image(file, Transfer::kSrgb);
  const int own = prepare::orientation_of(read_binary_file(file));
  const int of_view = prepare::orientation_of(read_binary_file(view.image_file));
  if (own == of_view) return image;
  image = prepare::turned_upright(std::move(image), own);
  const bool lies_down =
      image.width != image.height && (image.width > image.height) == (view.intrinsics.width > view.intrinsics.height);
  if (of_view > 4 && lies_down) return image;  // painted on the stored pixels, in a file without the note
  return prepare::turned_upright(std::move(image), turning_back(of_view));
}

/// @param kind  strokes: only what is painted on counts
KnownColors load_colors(const NamedFile& named, KnownColorKind kind, const View& view) {
  const LinearImage image = picture_of_view(named.file, view);
  const Intrinsics& lens = view.intrinsics;
  const double ratio = double(image.width) * lens.height / (double(image.height) * lens.width);
  if (std::abs(ratio - 1) > 0.02) {
    throw InputError(named.file, "size",
                     fmt::format("{} x {} is not the shape of {}, {} x {}", image.width, image.height, view.name,
                                 lens.width, lens.height));
  }
  if (image.channels != 3) throw InputError(named.file, "channels", "expected a colour picture, found a grey one");
  KnownColors known{kind, view.name, image.width, image.height, {}, {}};
  double chroma = 0, painted = 0;
  for (std::size_t p = 0; p < image.pixel_count(); ++p) {
    const float alpha = image.alpha.empty() ? 1.0f : image.alpha[p];
    const bool counts = alpha > kStrokeAlpha;
    const float* rgb = &image.values[3 * p];
    const Ab color = counts ? ab_of_linear_rgb({rgb[0] / alpha, rgb[1] / alpha, rgb[2] / alpha}) : Ab{};
    known.ab.push_back(color);
    known.is_known.push_back(counts ? 1 : 0);
    chroma += std::hypot(color.a, color.b);
    painted += counts ? 1 : 0;
  }
  if (painted == 0) throw InputError(named.file, "alpha", "nothing is painted on it");
  if (kind == KnownColorKind::kStrokes && painted == double(image.pixel_count())) {
    throw InputError(named.file, "alpha", "a hint picture is transparent except for its strokes; this one is opaque");
  }
  if (kind == KnownColorKind::kKeyFrame && chroma / painted < kLeastMeanChroma) {
    throw InputError(named.file, "colour", "a key frame must be in colour; this one is grey");
  }
  return known;
}

double number_of(const std::string& text, const std::string& entry) {
  const std::optional<double> value = value_in<double>(text);
  if (value && std::isfinite(*value)) return *value;
  throw UsageError(entry + ": expected x,y,VIEW,#rrggbb, found " + text + " for a number");
}

Ab color_of(const std::string& text, const std::string& entry, Palette& palette) {
  const std::optional<Ab> color = ab_of_hex(palette.find(text).value_or(text));
  if (color) return *color;
  throw UsageError(entry + ": expected a colour like #c08040 or a word of --palette (" + palette.words() + "), found " +
                   text);
}

/// "x,y,VIEW,#rrggbb", or with a word of the palette: a dot, in pixels of the view's image file. Dots of one view are
/// one source, or each would run over those before it.
void add_dot(const std::string& hint, const Capture& capture, Palette& palette, std::vector<KnownColors>& dots) {
  const std::string entry = "--hint " + hint;
  const std::vector<std::string> parts = split(hint, ',');
  if (parts.size() != 4) throw UsageError(entry + ": expected x,y,VIEW,#rrggbb or x,y,VIEW,WORD");
  const View& view = training_view(capture, parts[2], entry);
  const ImageHeader file = image_header(view.image_file);
  const double x = number_of(parts[0], entry), y = number_of(parts[1], entry);
  if (x < 0 || y < 0 || x >= file.width || y >= file.height) {
    throw UsageError(fmt::format("{}: the picture has {} x {} pixels", entry, file.width, file.height));
  }
  const Intrinsics& lens = view.intrinsics;
  const Ab color = color_of(parts[3], entry, palette);
  const auto of_view = std::ranges::find(dots, view.name, &KnownColors::view);
  if (of_view == dots.end()) {
    const auto pixels = std::size_t(lens.width) * std::size_t(lens.height);
    dots.push_back({KnownColorKind::kStrokes, view.name, lens.width, lens.height, std::vector<Ab>(pixels, color),
                    std::vector<std::uint8_t>(pixels)});
  } else {
    std::rotate(of_view, of_view + 1, dots.end());  // what was said last corrects other views' dots too
  }
  KnownColors& known = dots.back();
  const double cx = x * lens.width / file.width, cy = y * lens.height / file.height;
  const double radius = std::max(1.5, kHintRadius * std::min(lens.width, lens.height));
  for (int py = 0; py < lens.height; ++py) {
    for (int px = 0; px < lens.width; ++px) {
      if (std::hypot(px + 0.5 - cx, py + 0.5 - cy) > radius) continue;
      const std::size_t p = std::size_t(py) * std::size_t(lens.width) + std::size_t(px);
      known.is_known[p] = 1;
      known.ab[p] = color;
    }
  }
}

/// What a stroke file paints on the capture's training views, and at viewpoints.
void add_painted(const fs::path& file, const Capture& capture, Palette& palette, GivenColors& given) {
  const PaintableViews views = paintable_views(capture);
  StrokeList list = read_strokes(file, views);
  for (Stroke& stroke : list.strokes) stroke.color = palette.find(stroke.word).value_or(stroke.color);
  std::vector<std::string> names = views.names;
  std::vector<Intrinsics> lenses;
  for (const View& view : capture.views) {
    if (!view.held_out) lenses.push_back(view.intrinsics);
  }
  given.viewpoints = painted_viewpoints(list);
  for (const Viewpoint& viewpoint : given.viewpoints) {
    names.push_back(viewpoint.name);
    lenses.push_back(viewpoint.camera.intrinsics());
  }
  for (KnownColors& paint : painted(list, names, lenses)) given.known.push_back(std::move(paint));
}

}  // namespace

std::size_t view_called(const Capture& capture, const std::string& name, const std::string& entry,
                        const std::vector<std::string>& other_names) {
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < capture.views.size(); ++i) {
    if (capture.views[i].name == name) return i;
    const fs::path view(capture.views[i].name);
    const bool is_other = i < other_names.size() && other_names[i] == name;
    if (is_other || view.filename() == name || view.stem() == name) places.push_back(i);
  }
  if (places.size() == 1) return places.front();
  throw UsageError(fmt::format("{}: {} views of the capture are called {}; they have names like {}", entry,
                               places.empty() ? "no" : std::to_string(places.size()), name,
                               capture.views.front().name));
}

GivenColors load_known_colors(const Capture& capture, const ColorizerOptions& config) {
  GivenColors given;
  Palette palette(config.palette);
  std::vector<KnownColors>& known = given.known;
  const auto load = [&](const std::string& list, const char* option, KnownColorKind kind) {
    for (const NamedFile& named : named_files(list, option)) {
      known.push_back(load_colors(named, kind, training_view(capture, named.view, named.entry)));
    }
  };
  load(config.keyframes, "--keyframe", KnownColorKind::kKeyFrame);
  load(config.hint_images, "--hint-image", KnownColorKind::kStrokes);
  std::vector<KnownColors> dots;
  for (const std::string& hint : split(config.hints, ';')) add_dot(hint, capture, palette, dots);
  std::ranges::move(dots, std::back_inserter(known));
  if (!config.strokes.empty()) add_painted(config.strokes, capture, palette, given);
  palette.refuse_unnamed();
  return given;
}

void make_files_absolute(ColorizerOptions& config) {
  const auto make_absolute = [](std::string& list, const char* option) {
    std::vector<std::string> items;
    for (const NamedFile& named : named_files(list, option)) {
      const std::string file = fs::absolute(named.file).string();
      const bool is_one = file.find(';') == std::string::npos;  // else the folder's name would part the list
      items.push_back(named.view + "=" + (is_one ? file : named.file.string()));
    }
    list = joined(items, ";");
  };
  make_absolute(config.keyframes, "--keyframe");
  make_absolute(config.hint_images, "--hint-image");
  if (!config.strokes.empty()) config.strokes = fs::absolute(config.strokes).string();
}

std::vector<fs::path> key_frame_files(const ColorizerOptions& config) {
  std::vector<fs::path> files;
  for (const NamedFile& named : named_files(config.keyframes, "--keyframe")) files.push_back(named.file);
  return files;
}

std::vector<std::string> key_frame_views(const Capture& capture, const ColorizerOptions& config) {
  std::vector<std::string> views;
  for (const NamedFile& named : named_files(config.keyframes, "--keyframe")) {
    views.push_back(training_view(capture, named.view, named.entry).name);
  }
  return views;
}

}  // namespace cnerf::pipeline
