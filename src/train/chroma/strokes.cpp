#include "src/train/chroma/strokes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <optional>
#include <set>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/color/colorspace_math.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

constexpr std::array<const char*, 5> kKinds = {"paint", "exact", "grey", "erase", "picture"};
constexpr std::size_t kPictureDigits = 12;
constexpr float kPaintedAlpha = 0.5f;
constexpr std::size_t kLongestId = 32, kLongestViewpointName = 40, kLongestWord = 64;
constexpr float kCovered = 0.5f;  // of a pixel: it is painted

void check_size(std::string_view text, const fs::path& file) {
  if (text.size() > kLargestStrokeFile) {
    throw InputError(file, "", fmt::format("expected at most {} bytes, got {}", kLargestStrokeFile, text.size()));
  }
}

/// Refuses a stroke of a file by the name of its field.
class StrokeCheck {
 public:
  StrokeCheck(const fs::path& file, std::size_t index) : file_(file), index_(index) {}

  void require(bool holds, const char* field, const std::string& problem) const {
    if (!holds) throw InputError(file_, fmt::format("strokes[{}].{}", index_, field), problem);
  }
  void in_range(float value, float least, float most, const char* field) const {
    require(value >= least && value <= most, field, fmt::format("expected {} to {}, got {}", least, most, value));
  }

 private:
  const fs::path& file_;
  std::size_t index_;
};

void check(const Stroke& stroke, const StrokeCheck& check, std::span<const std::string> views) {
  const bool is_plain = std::ranges::all_of(stroke.id, [](unsigned char c) { return std::isalnum(c) != 0; });
  check.require(is_plain && !stroke.id.empty() && stroke.id.size() <= kLongestId, "id",
                fmt::format("expected 1 to {} letters and digits", kLongestId));
  check.require(std::ranges::find(views, stroke.view) != views.end(), "view",
                "no training view or viewpoint is called " + excerpt(nlohmann::ordered_json(stroke.view)));
  check.require(std::ranges::find(kKinds, stroke.kind) != kKinds.end(), "kind",
                "expected paint, exact, grey, erase or picture, got " + excerpt(nlohmann::ordered_json(stroke.kind)));
  check.require(ab_of_hex(stroke.color).has_value(), "color",
                "expected a colour like #c08040, got " + excerpt(nlohmann::ordered_json(stroke.color)));
  check.require(stroke.word.size() <= kLongestWord && stroke.word.find_first_of(",;=#") == std::string::npos, "word",
                fmt::format("expected at most {} bytes and none of , ; = #", kLongestWord));
  check.in_range(stroke.size, 0.0005f, 0.5f, "size");
  check.in_range(stroke.softness, 0, 1, "softness");
  check.in_range(stroke.reach, 0.1f, 4, "reach");
  const bool is_picture = stroke.kind == "picture";
  const bool is_number = std::ranges::all_of(stroke.picture, [](char c) { return std::isxdigit(c) != 0; });
  check.require(is_picture ? stroke.picture.size() == kPictureDigits && is_number : stroke.picture.empty(), "picture",
                is_picture ? fmt::format("expected {} hexadecimal digits", kPictureDigits) : "only pictures have one");
  check.require(stroke.points.empty() == is_picture && stroke.points.size() <= kMostStrokePoints, "points",
                is_picture ? "pictures have none"
                           : fmt::format("expected 1 to {} points, got {}", kMostStrokePoints, stroke.points.size()));
  for (const StrokePoint& point : stroke.points) {
    // A brush may start beside the picture.
    check.in_range(point[0], -1, 2, "points");
    check.in_range(point[1], -1, 2, "points");
    check.in_range(point[2], 0, 1, "points");
  }
}

void check(const std::vector<Viewpoint>& viewpoints, const fs::path& file, const PaintableViews& views) {
  if (viewpoints.size() > kMostViewpoints) {
    throw InputError(file, "viewpoints",
                     fmt::format("expected at most {}, got {}", kMostViewpoints, viewpoints.size()));
  }
  std::set<std::string> taken(views.names.begin(), views.names.end());
  taken.insert(views.held_out.begin(), views.held_out.end());
  for (std::size_t i = 0; i < viewpoints.size(); ++i) {
    const auto& [name, camera] = viewpoints[i];
    const std::string where = fmt::format("viewpoints[{}].", i);
    const bool is_plain = std::ranges::all_of(name, [](unsigned char c) { return std::isalnum(c) != 0 || c == '-'; });
    if (!is_plain || name.empty() || name.size() > kLongestViewpointName) {
      throw InputError(file, where + "name",
                       fmt::format("expected 1 to {} letters, digits and -", kLongestViewpointName));
    }
    if (!taken.insert(name).second) throw InputError(file, where + "name", "another view or viewpoint has it: " + name);
    check_camera(camera, kLargestViewpoint, file, where);
  }
}

/// Distance of a place to a segment, and how far along it the nearest point lies.
struct Nearest {
  float distance, along;
};
Nearest nearest(float x, float y, const StrokePoint& a, const StrokePoint& b) {
  const float dx = b[0] - a[0], dy = b[1] - a[1], squared = dx * dx + dy * dy;
  const float along = squared > 0 ? std::clamp(((x - a[0]) * dx + (y - a[1]) * dy) / squared, 0.0f, 1.0f) : 0.0f;
  return {std::hypot(x - a[0] - along * dx, y - a[1] - along * dy), along};
}

/// Over what was painted before it.
void put_picture(const PaintedPicture& picture, float reach, KnownColors& paint) {
  for (int y = 0; y < paint.height; ++y) {
    for (int x = 0; x < paint.width; ++x) {
      const int row = std::min(int((y + 0.5f) / float(paint.height) * float(picture.height)), picture.height - 1);
      const int column = std::min(int((x + 0.5f) / float(paint.width) * float(picture.width)), picture.width - 1);
      const auto from = std::size_t(row) * std::size_t(picture.width) + std::size_t(column);
      const auto to = std::size_t(y) * std::size_t(paint.width) + std::size_t(x);
      if (picture.is_known[from] == 0) continue;
      paint.is_known[to] = 1;
      paint.ab[to] = picture.ab[from];
      paint.reach[to] = reach;
    }
  }
}

}  // namespace

PaintedPicture painted_picture(const LinearImage& image, const fs::path& name) {
  PaintedPicture picture{image.width, image.height, {}, {}};
  std::size_t painted = 0;
  for (std::size_t p = 0; p < image.pixel_count(); ++p) {
    const float alpha = image.alpha.empty() ? 1.0f : image.alpha[p];
    const bool counts = alpha > kPaintedAlpha;
    const float* pixel = &image.values[std::size_t(image.channels) * p];
    const Vec3f light = image.channels == 3 ? Vec3f{pixel[0], pixel[1], pixel[2]} : Vec3f{pixel[0], pixel[0], pixel[0]};
    picture.ab.push_back(counts ? ab_of_linear_rgb(light / alpha) : Ab{});
    picture.is_known.push_back(counts ? 1 : 0);
    painted += counts ? 1 : 0;
  }
  if (painted == 0) throw InputError(name, "alpha", "nothing is painted on it");
  if (painted == image.pixel_count()) {
    throw InputError(name, "alpha", "a painted picture is transparent except for its paint; this one is opaque");
  }
  return picture;
}

std::shared_ptr<const PaintedPicture> PaintedPictures::find(const std::string& picture) {
  const std::lock_guard lock(mutex_);
  auto found = read_.find(picture);
  if (found == read_.end()) {
    const fs::path from = file(picture);
    auto painted = std::make_shared<PaintedPicture>(painted_picture(read_linear_image(from, Transfer::kSrgb), from));
    found = read_.emplace(picture, std::move(painted)).first;
  }
  return found->second;
}

StrokeList strokes_of_json(std::string_view text, const fs::path& file, const PaintableViews& views,
                           PaintedPictures& pictures) {
  check_size(text, file);
  auto list = record_of<StrokeList>(parse_json(text, file), file);
  if (list.strokes.size() > kMostStrokes) {
    throw InputError(file, "strokes", fmt::format("expected at most {}, got {}", kMostStrokes, list.strokes.size()));
  }
  check(list.viewpoints, file, views);
  std::vector<std::string> names = views.names;
  for (const Viewpoint& viewpoint : list.viewpoints) names.push_back(viewpoint.name);
  std::set<std::string> ids;
  for (std::size_t i = 0; i < list.strokes.size(); ++i) {
    const StrokeCheck of_stroke(file, i);
    check(list.strokes[i], of_stroke, names);
    of_stroke.require(ids.insert(list.strokes[i].id).second, "id", "another stroke has it: " + list.strokes[i].id);
    if (const std::string& picture = list.strokes[i].picture; !picture.empty()) {
      const fs::path painted = pictures.file(picture);
      of_stroke.require(fs::exists(painted), "picture", "there is no " + painted.string());
      list.strokes[i].painted = pictures.find(picture);
    }
  }
  return list;
}

StrokeList read_strokes(const fs::path& file, const PaintableViews& views) {
  PaintedPictures pictures(file.parent_path());
  return strokes_of_json(read_text_file(file), file, views, pictures);
}

void write_strokes(const fs::path& file, const StrokeList& list) {
  const std::string text = json_of(list).dump() + "\n";
  check_size(text, file);
  write_file(file, text);
}

std::optional<Ab> ab_of_hex(const std::string& color) {
  unsigned rgb = 0;
  const char *begin = color.data() + 1, *end = color.data() + color.size();
  const bool is_hex = color.size() == 7 && color[0] == '#' && std::from_chars(begin, end, rgb, 16).ptr == end;
  if (!is_hex) return std::nullopt;
  const auto channel = [&](int shift) { return linear_from_srgb(float((rgb >> shift) & 255u) / 255.0f); };
  return ab_of_linear_rgb({channel(16), channel(8), channel(0)});
}

PaintableViews paintable_views(const Capture& capture) {
  PaintableViews views;
  for (const View& view : capture.views) (view.held_out ? views.held_out : views.names).push_back(view.name);
  return views;
}

std::vector<Viewpoint> painted_viewpoints(const StrokeList& list) {
  std::vector<Viewpoint> painted;
  for (const Viewpoint& viewpoint : list.viewpoints) {
    const bool is_named = std::ranges::find(list.strokes, viewpoint.name, &Stroke::view) != list.strokes.end();
    if (is_named) painted.push_back(viewpoint);
  }
  return painted;
}

void cover(const Stroke& stroke, int width, int height, std::span<float> coverage) {
  CNERF_CHECK(coverage.size() == std::size_t(width) * std::size_t(height), "coverage of the picture's size");
  const float full = stroke.size * float(std::min(width, height)) / 2;
  std::vector<StrokePoint> at;  // in pixels
  for (const StrokePoint& p : stroke.points) at.push_back({p[0] * float(width), p[1] * float(height), p[2]});
  for (std::size_t i = 0; i < at.size(); ++i) {
    const StrokePoint &a = at[i], &b = at[std::min(i + 1, at.size() - 1)];
    if (i > 0 && i + 1 == at.size()) break;  // the last point ends the segment before it
    const float reach = full + 1;
    const auto low = [&](int axis, int limit) {
      return std::clamp(int(std::floor(std::min(a[axis], b[axis]) - reach)), 0, limit);
    };
    const auto high = [&](int axis, int limit) {
      return std::clamp(int(std::ceil(std::max(a[axis], b[axis]) + reach)), 0, limit);
    };
    for (int y = low(1, height); y < high(1, height); ++y) {
      for (int x = low(0, width); x < high(0, width); ++x) {
        const Nearest near = nearest(float(x) + 0.5f, float(y) + 0.5f, a, b);
        const float radius = std::max(full * (a[2] + (b[2] - a[2]) * near.along), 0.5f);
        const float fade = std::max(stroke.softness * radius, 1.0f);  // at least over a pixel
        const float value = std::clamp((radius + 0.5f - near.distance) / fade, 0.0f, 1.0f);
        float& there = coverage[std::size_t(y) * std::size_t(width) + std::size_t(x)];
        there = std::max(there, value);
      }
    }
  }
}

KnownColors painted_on(const std::string& view, std::span<const Stroke> strokes, int width, int height) {
  const std::size_t pixels = std::size_t(width) * std::size_t(height);
  KnownColors paint{KnownColorKind::kStrokes,
                    view,
                    width,
                    height,
                    std::vector<Ab>(pixels),
                    std::vector<std::uint8_t>(pixels, 0),
                    std::vector<float>(pixels, 0.0f)};
  std::vector<float> coverage(pixels);
  for (const Stroke& stroke : strokes) {
    if (stroke.view != view || stroke.hidden) continue;
    if (stroke.painted) {
      put_picture(*stroke.painted, stroke.reach, paint);
      continue;
    }
    std::ranges::fill(coverage, 0.0f);
    cover(stroke, width, height, coverage);
    const Ab color = stroke.kind == "grey" ? Ab{} : ab_of_hex(stroke.color).value_or(Ab{});
    for (std::size_t p = 0; p < pixels; ++p) {
      if (coverage[p] < kCovered) continue;
      paint.is_known[p] = stroke.kind == "erase" ? 0 : 1;
      paint.ab[p] = paint.is_known[p] != 0 ? color : Ab{};
      paint.reach[p] = stroke.kind == "exact" ? 0.0f : stroke.reach;
    }
  }
  return paint;
}

std::vector<KnownColors> painted(const StrokeList& list, std::span<const std::string> names,
                                 std::span<const Intrinsics> lenses) {
  CNERF_CHECK(names.size() == lenses.size(), "one lens per view");
  std::vector<KnownColors> known;
  for (std::size_t v = 0; v < names.size(); ++v) {
    if (std::ranges::find(list.strokes, names[v], &Stroke::view) == list.strokes.end()) continue;
    KnownColors paint = painted_on(names[v], list.strokes, lenses[v].width, lenses[v].height);
    paint.everywhere = list.everywhere;
    if (std::ranges::find(paint.is_known, 1) != paint.is_known.end()) known.push_back(std::move(paint));
  }
  return known;
}

}  // namespace cnerf
