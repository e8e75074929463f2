/// What the studio answers, on the threads of the server.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <memory>
#include <opencv2/core.hpp>
#include <utility>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/usage.h"
#include "src/capture/image_io.h"
#include "src/picture/encode.h"
#include "src/prepare/photographs.h"
#include "src/studio/paint_files.h"
#include "src/studio/studio.h"

namespace cnerf::studio {
namespace fs = std::filesystem;
using web::PageAnswer;
using web::PageRequest;
using web::refusal;

namespace {

constexpr std::size_t kLargestPicture = std::size_t(32) << 20;
constexpr std::size_t kMostSides = 2;
constexpr int kThumbnailWidth = 160, kReferenceWidth = 1600;
constexpr int kPhotoQuality = 92, kThumbnailQuality = 82;
constexpr std::uint8_t kReachAlpha = 200;
constexpr double kSameShape = 0.02;  // of a painted picture and its photograph

/// Strokes that are not saved yet, and the number of what they are seen on.
struct ReachMessage {
  int view = 0;
  std::vector<Stroke> strokes;
  bool everywhere = false;  ///< as StrokeList has it

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("view", self.view);
    v("strokes", self.strokes);
    v("everywhere", self.everywhere, kOptional);
  }
};

/// As the options' own check would.
void check_finish(const Finish& finish) {
  const auto in_range = [](double value, double least, double most, const char* field) {
    if (!(value >= least && value <= most)) {
      throw InputError("order", field, fmt::format("expected {} to {}, got {}", least, most, value));
    }
  };
  in_range(finish.saturation, 0, 4, "saturation");
  in_range(finish.hue, -180, 180, "hue");
  in_range(finish.exposure, -10, 10, "exposure");
}

/// A picture of any content.
/// @param folder  for the while
/// @param name    that errors have
LinearImage decoded_image(const std::string& bytes, const fs::path& folder, const std::string& name) {
  const NewFile file(folder / "upload.png");  // what a picture is, its content says
  if (std::ofstream out(file.temporary(), std::ios::binary); !(out << bytes).flush()) {
    throw OutputError(file.temporary().string() + ": cannot be written");
  }
  try {
    return read_linear_image(file.temporary(), Transfer::kSrgb);
  } catch (const InputError&) {
    throw InputError(name.empty() ? "picture" : name, "", "expected a PNG, JPEG, TIFF or WebP picture");
  }
}

/// Of the path; -1 where it is too large.
int number_at_end(const PageRequest& request) {
  return number_in(std::string_view(request.path).substr(request.path.rfind('/') + 1)).value_or(-1);
}

/// A lens of a picture that is no larger than this.
Intrinsics fitted(const Intrinsics& lens, int side) {
  const double factor = std::min(1.0, double(side) / std::max(lens.width, lens.height));
  return resized(lens, std::max(1, int(lens.width * factor)), std::max(1, int(lens.height * factor)));
}

Picture grey_of(const MonoImage& image) {
  std::vector<float> light(image.pixel_count());
  for (std::size_t p = 0; p < light.size(); ++p) light[p] = image.stored_luminance(p);
  return picture_from_linear(image.width, image.height, light);
}

}  // namespace

std::span<const Route<Studio>> Studio::routes() {
  static const Route<Studio> routes[] = {
      {"GET", "/studio/scene", 0, &Studio::get_scene},
      {"GET", "/studio/state", 0, &Studio::get_state},
      {"GET", "/studio/events", 0, &Studio::get_state},
      {"GET", "/studio/photos/", 0, &Studio::get_photo},
      {"GET", "/studio/thumbnails/", 0, &Studio::get_thumbnail},
      {"GET", "/studio/strokes", 0, &Studio::get_strokes},
      {"PUT", "/studio/strokes", kLargestStrokeFile, &Studio::put_strokes},
      {"GET", "/studio/painted", 0, &Studio::get_painted},
      {"GET", "/studio/reach/", 0, &Studio::get_reach},
      {"POST", "/studio/reach", kLargestStrokeFile, &Studio::post_reach},
      {"POST", "/studio/frame", kSmallBody, &Studio::post_frame},
      {"POST", "/studio/orders", kSmallBody, &Studio::post_order},
      {"POST", "/studio/pictures", kLargestPicture, &Studio::post_picture},
      {"GET", "/studio/cards/", 0, &Studio::get_card},
      {"GET", "/studio/files/", 0, &Studio::get_file},
  };
  return routes;
}

// ---- looking ------------------------------------------------------------------------------------------------------

PageAnswer Studio::get_scene(const PageRequest& /*request*/) {
  const std::lock_guard lock(mutex_);
  return {.body = scene_};
}

PageAnswer Studio::get_state(const PageRequest& /*request*/) {
  return {.body = board_.text()};
}

Studio::Paintable Studio::numbered(int number, const StrokeList& list) const {
  const std::vector<View>& views = context_.capture.views;
  const auto place = std::size_t(number);  // of a number below 0 it is too large
  if (place < views.size()) return {&views[place], {}};
  if (place - views.size() < list.viewpoints.size()) return {nullptr, list.viewpoints[place - views.size()]};
  throw MissingInputError(fmt::format("view: there are {} and {} viewpoints", views.size(), list.viewpoints.size()));
}

Studio::Paintable Studio::numbered_in(const PageRequest& request) const {
  const std::lock_guard lock(mutex_);
  return numbered(number_at_end(request), strokes_);
}

PageAnswer Studio::get_photo(const PageRequest& request) {
  const Paintable wanted = numbered_in(request);
  const auto parameter = request.parameters.find("side");
  const bool is_whole = parameter == request.parameters.end();
  const int side = is_whole ? kLargestViewpoint : std::max(number_in(parameter->second).value_or(0), 16);
  if (wanted.view == nullptr) return viewpoint_photo(wanted.viewpoint, side);
  Picture picture = grey_of(wanted.view->image);
  if (!is_whole) picture = scaled_down(picture, fitted(wanted.lens(), side).width);
  return {.type = "image/jpeg", .body = text_of(jpeg_bytes(picture, kPhotoQuality))};
}

/// What the field shows there. A whole one is kept, once the field is trained.
PageAnswer Studio::viewpoint_photo(const Viewpoint& viewpoint, int side) {
  FieldCamera camera = camera_of(viewpoint.camera);
  camera.lens = fitted(camera.lens, side);
  const bool is_whole = camera.lens == viewpoint.camera.intrinsics();
  {
    const std::lock_guard lock(mutex_);
    const auto kept = std::ranges::find(photos_, viewpoint, &Photo::of);
    if (is_whole && kept != photos_.end()) return {.type = "image/jpeg", .body = kept->jpeg};
  }
  // Who opens one waits for it.
  auto jpeg = asked_alone(is_whole, [this, viewpoint, camera, is_whole](const std::function<bool()>& keep_going) {
    const std::vector<Side> grey = {nullptr};
    const DrawingEffort effort = sharp_effort(context_.config.render.steps_per_box);
    const bool is_training = !coloring_ && !halted_;
    const std::vector<Picture> pictures =
        draw_field(*field_, is_training ? affordable(camera) : camera, grey, effort, keep_going);
    if (pictures.empty()) return std::optional<std::string>();
    std::string bytes = text_of(jpeg_bytes(pictures.front(), kPhotoQuality));
    const std::lock_guard lock(mutex_);
    const bool is_saved = std::ranges::find(strokes_.viewpoints, viewpoint) != strokes_.viewpoints.end();
    const bool is_kept = std::ranges::find(photos_, viewpoint, &Photo::of) != photos_.end();
    if (is_whole && is_saved && !is_kept && coloring_) photos_.push_back({viewpoint, bytes});
    return std::optional(std::move(bytes));
  });
  if (!jpeg) return {.status = 204};
  return {.type = "image/jpeg", .body = std::move(*jpeg)};
}

PageAnswer Studio::viewpoint_thumbnail(const Viewpoint& viewpoint) {
  FieldCamera camera = camera_of(viewpoint.camera);
  const int width = std::min(camera.lens.width, kThumbnailWidth);
  camera.lens = resized(camera.lens, width, std::max(1, camera.lens.height * width / camera.lens.width));
  auto jpeg = asked_alone(false, [this, camera](const std::function<bool()>& keep_going) {
    const std::vector<Side> now = {side_named(kNow)};
    const DrawingEffort effort = sharp_effort(context_.config.render.steps_per_box, finish());
    const std::vector<Picture> pictures = draw_field(*field_, camera, now, effort, keep_going);
    return pictures.empty() ? std::nullopt : std::optional(text_of(jpeg_bytes(pictures.front(), kThumbnailQuality)));
  });
  if (!jpeg) return {.status = 204};
  return {.type = "image/jpeg", .body = std::move(*jpeg)};
}

/// A client of its own each, so that none makes another stale.
std::optional<std::string> Studio::asked_alone(bool is_urgent, FrameDesk::Drawing drawing) {
  return frames_.ask(fmt::format("alone {}", ++asked_alone_), is_urgent, std::move(drawing));
}

PageAnswer Studio::get_thumbnail(const PageRequest& request) {
  const Paintable wanted = numbered_in(request);
  if (wanted.view == nullptr) return viewpoint_thumbnail(wanted.viewpoint);
  if (wanted.is_held_out() || !is_ready()) {
    const Picture grey = scaled_down(grey_of(wanted.view->image), kThumbnailWidth);
    return {.type = "image/jpeg", .body = text_of(jpeg_bytes(grey, kThumbnailQuality))};
  }
  const std::string& name = wanted.name();
  auto drawn = asked_alone(false, [this, name](const auto&) {
    const SeenSurfaces& seen = *coloring_->seen();
    const Picture picture =
        draw_cached(seen.views()[seen.view_named(name)], side_named(kNow), kThumbnailWidth, finish());
    return std::optional(text_of(jpeg_bytes(picture, kThumbnailQuality)));
  });
  if (!drawn) return {.status = 204};
  return {.type = "image/jpeg", .body = std::move(*drawn)};
}

PageAnswer Studio::post_frame(const PageRequest& request) {
  const auto message = record_of<FrameMessage>(parse_json(request.body, "frame"), "frame");
  (void)camera_of(message);  // refuses
  if (message.sides.empty() || message.sides.size() > kMostSides) {
    throw InputError("frame", "sides", "expected one or two");
  }
  struct Seen {
    std::uint64_t colors = 0;
    double seconds = 0;
    std::vector<std::size_t> sizes;  // of the pictures, bytes
  };
  const auto seen = std::make_shared<Seen>();
  auto drawn =
      frames_.ask(request.client, message.moving, [this, message, seen](const std::function<bool()>& keep_going) {
        seen->colors = board_.read([](const StateMessage& state) { return state.colors; });
        const Stopwatch watch;
        std::string all;
        for (const std::string& jpeg : this->drawn(message, keep_going)) {
          seen->sizes.push_back(jpeg.size());
          all += jpeg;
        }
        seen->seconds = watch.seconds();
        return all.empty() ? std::nullopt : std::optional(std::move(all));
      });
  if (!drawn) return {.status = 204};
  return {.type = "image/jpeg",
          .body = std::move(*drawn),
          .headers = {{"X-Cnerf-Colors", std::to_string(seen->colors)},
                      {"X-Cnerf-Sizes", fmt::format("{}", fmt::join(seen->sizes, ","))},
                      {"X-Cnerf-Milliseconds", fmt::format("{:.1f}", 1000 * seen->seconds)}}};
}

// ---- painting -----------------------------------------------------------------------------------------------------

PageAnswer Studio::get_strokes(const PageRequest& /*request*/) {
  const std::lock_guard lock(mutex_);
  return {.body = json_of(strokes_).dump()};
}

PageAnswer Studio::put_strokes(const PageRequest& request) {
  StrokeList list = strokes_of_json(request.body, "strokes", paintable_views(context_.capture), painted_);
  if (!request.revision) return refusal(428, "the header X-Cnerf-Revision is missing");
  const std::lock_guard lock(mutex_);
  if (auto why = board_.become_writer(request.client)) return *why;
  if (*request.revision != strokes_.revision) return refusal(409, "another tab was faster");
  save(std::move(list));
  return {.body = nlohmann::json{{"revision", strokes_.revision}}.dump()};
}

/// Under the lock.
void Studio::save(StrokeList list) {
  list.revision = strokes_.revision + 1;
  write_strokes(stroke_folder(context_) / kStrokeFile, list);
  strokes_ = std::move(list);
  std::erase_if(photos_, [this](const Photo& photo) {
    return std::ranges::find(strokes_.viewpoints, photo.of) == strokes_.viewpoints.end();
  });
  board_.change([&](StateMessage& state) { state.strokes = strokes_.revision; });
}

PageAnswer Studio::get_reach(const PageRequest& request) {
  return reach_of(number_at_end(request), saved_strokes(), true);
}

PageAnswer Studio::post_reach(const PageRequest& request) {
  const auto message = record_of<ReachMessage>(parse_json(request.body, "reach"), "reach");
  StrokeList list = saved_strokes();
  // As those of a file are.
  const StrokeList added{0, message.strokes, list.viewpoints};
  const StrokeList checked =
      strokes_of_json(json_of(added).dump(), "reach", paintable_views(context_.capture), painted_);
  for (const Stroke& stroke : checked.strokes) {
    std::erase_if(list.strokes, [&](const Stroke& saved) { return saved.id == stroke.id; });
    list.strokes.push_back(stroke);
  }
  list.everywhere = message.everywhere;
  return reach_of(message.view, list, checked.strokes.empty());
}

/// Each in a turn of its own, so that frames need not wait for all.
void Studio::see(const std::vector<Viewpoint>& viewpoints) {
  for (const Viewpoint& viewpoint : viewpoints) {
    if (const auto reading = coloring_->reading(); coloring_->has_seen(std::span(&viewpoint, 1))) continue;
    (void)asked_alone(false, [this, viewpoint](const auto&) {
      coloring_->see(std::span(&viewpoint, 1), {});
      return std::optional<std::string>("");
    });
  }
}

PageAnswer Studio::reach_of(int view, const StrokeList& list, bool is_saved) {
  const Paintable wanted = numbered(view, list);
  if (!is_ready()) return refusal(503, "the views are being looked at; in a moment");
  if (wanted.is_held_out()) throw MissingInputError(wanted.name() + " is held out for evaluation");
  std::vector<Viewpoint> viewpoints = painted_viewpoints(list);
  const bool is_unpainted = std::ranges::find(viewpoints, wanted.viewpoint) == viewpoints.end();
  if (wanted.view == nullptr && is_unpainted) viewpoints.push_back(wanted.viewpoint);
  see(viewpoints);
  const auto reading = coloring_->reading();
  if (!coloring_->has_seen(viewpoints)) return refusal(503, "the viewpoints are being looked at; in a moment");
  const SeenSurfaces& seen = *coloring_->seen();
  const std::size_t cached = seen.view_named(wanted.name());
  // A stroke that is being drawn is another one next time.
  const auto strokes = is_saved ? coloring_->known(list) : std::make_shared<const KnownStrokes>(list, seen);
  const CachedView& shown = seen.views()[cached];
  const cv::Mat overlay = colors_at_luminance(*strokes->in(cached), {shown.width, shown.height}, kReachAlpha,
                                              [&](std::size_t p) { return shown.luminance[p]; });
  return {.type = "image/png", .body = text_of(png_bytes(overlay))};
}

// ---- orders -------------------------------------------------------------------------------------------------------

PageAnswer Studio::post_order(const PageRequest& request) {
  const auto order = record_of<OrderMessage>(parse_json(request.body, "order"), "order");
  if (order.order == "stop" || order.order == "finish") return change_at_once(request, order);
  if (!is_order_of_pages(order.order)) {
    throw InputError("order", "order", "this studio cannot do " + excerpt(nlohmann::ordered_json(order.order)));
  }
  return take_order(request, {order, {}});
}

/// What needs no work, and is taken beside it.
PageAnswer Studio::change_at_once(const PageRequest& request, const OrderMessage& order) {
  if (order.order == "finish") check_finish(order.finish);
  const std::lock_guard lock(mutex_);
  if (auto why = board_.become_writer(request.client)) return *why;
  if (order.order == "stop") {
    stop_requested_ = true;
  } else {
    board_.change([&](StateMessage& state) {
      state.finish = order.finish;
      ++state.colors;
    });
  }
  return {.status = 202, .body = board_.text()};
}

/// Under the lock.
std::optional<PageAnswer> Studio::refused_order(const std::string& client) {
  if (auto why = board_.become_writer(client)) return why;
  if (!is_working_ && !order_) return std::nullopt;
  return refusal(409, "wait until it is done: " + board_.read([](const StateMessage& state) { return state.task; }));
}

PageAnswer Studio::take_order(const PageRequest& request, const Order& order) {
  const std::lock_guard lock(mutex_);
  if (auto why = refused_order(request.client)) return *why;
  order_ = order;
  stop_requested_ = false;
  board_.change([&](StateMessage& state) {
    state.task = order.message.order;
    state.message.clear();
    state.failed = false;
  });
  work_.notify_all();
  return {.status = 202, .body = board_.text()};
}

/// Pictures are checked like any file, and stay in the run: a photograph to colour like, or what a paint program
/// painted on one of the capture's.
PageAnswer Studio::post_picture(const PageRequest& request) {
  const auto parameter = [&](const char* name) {
    const auto found = request.parameters.find(name);
    return found == request.parameters.end() ? std::string() : found->second;
  };
  const std::string name = sha256(std::as_bytes(std::span(request.body))).substr(0, 12);
  const std::string shown = parameter("name").substr(0, 80), kind = parameter("kind");
  if (kind == "stroke") return add_painted(request, number_in(parameter("view")), name, shown);
  if (kind != "reference") return refusal(400, "kind: this studio takes pictures as reference or stroke");
  {
    const std::lock_guard lock(mutex_);
    if (auto why = refused_order(request.client)) return *why;  // before anything is written
  }
  const fs::path folder = stroke_folder(context_) / "references";
  const int orientation = prepare::orientation_of(std::as_bytes(std::span(request.body)));
  const LinearImage image = prepare::turned_upright(decoded_image(request.body, folder, shown), orientation);
  if (is_monochrome(image)) throw InputError("picture", "colour", "a reference must be in colour; this one is grey");
  const Picture picture = scaled_down(picture_from_linear(image.width, image.height, image.values), kReferenceWidth);
  const fs::path file = folder / (name + ".png");
  if (image.alpha.empty()) {
    write_file(file, png_bytes(picture));
  } else {
    write_file(file, request.body);  // a fit leaves out what is transparent
  }
  Order order{{}, file};
  order.message.order = "reference";
  return take_order(request, order);
}

PageAnswer Studio::add_painted(const PageRequest& request, std::optional<int> view, const std::string& name,
                               const std::string& shown) {
  const Paintable of = numbered(view.value_or(-1), saved_strokes());
  if (of.is_held_out()) throw InputError("picture", "view", of.name() + " is held out for evaluation");
  const Intrinsics lens = of.lens();
  const PaintedPicture picture =
      painted_picture(decoded_image(request.body, stroke_folder(context_), shown), shown.empty() ? "picture" : shown);
  const double ratio = double(picture.width) * lens.height / (double(picture.height) * lens.width);
  if (std::abs(ratio - 1) > kSameShape) {
    throw InputError(shown.empty() ? "picture" : shown, "size",
                     fmt::format("{} x {} is not the shape of {}, {} x {}", picture.width, picture.height, of.name(),
                                 lens.width, lens.height));
  }
  const std::lock_guard lock(mutex_);
  if (auto why = board_.become_writer(request.client)) return *why;
  StrokeList list = strokes_;
  if (list.strokes.size() >= kMostStrokes) throw InputError("strokes", "", "there are too many strokes already");
  if (of.view == nullptr && std::ranges::find(list.viewpoints, of.viewpoint) == list.viewpoints.end()) {
    throw MissingInputError("view: it is gone");
  }
  write_file(painted_.file(name), request.body);
  Stroke stroke{.id = "p" + name + std::to_string(list.revision), .view = of.name(), .kind = "picture"};
  stroke.picture = name;
  stroke.painted = painted_.find(name);
  list.strokes.push_back(std::move(stroke));
  save(std::move(list));
  return {.status = 202, .body = board_.text()};
}

PageAnswer Studio::get_painted(const PageRequest& request) {
  const auto wanted = request.parameters.find("picture");
  const bool is_named = wanted != request.parameters.end() && !wanted->second.empty();
  const auto has_it = [&](const Stroke& stroke) { return stroke.picture == wanted->second; };
  if (!is_named || std::ranges::none_of(saved_strokes().strokes, has_it)) {
    throw MissingInputError("no stroke has this picture");
  }
  return {.type = "image/png", .file = painted_.file(wanted->second)};
}

PageAnswer Studio::get_card(const PageRequest& request) {
  const auto number = std::size_t(number_at_end(request));
  const std::lock_guard lock(mutex_);
  if (number >= cards_.size()) throw MissingInputError("there is no such card");
  return {.type = "image/jpeg", .body = cards_[number]};
}

PageAnswer Studio::get_file(const PageRequest& request) {
  const auto number = std::size_t(number_at_end(request));
  const std::lock_guard lock(mutex_);
  if (number >= downloads_.size()) throw MissingInputError("not here");
  return {.headers = {{"Content-Disposition", "attachment"}}, .file = downloads_[number]};
}

}  // namespace cnerf::studio
