/// What the studio answers, on the threads of the server.

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <memory>
#include <opencv2/core.hpp>
#include <utility>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/usage.h"
#include "src/capture/image_io.h"
#include "src/picture/encode.h"
#include "src/studio/paint_files.h"
#include "src/studio/studio.h"

namespace cnerf::studio {
namespace fs = std::filesystem;
using web::PageAnswer;
using web::PageRequest;
using web::refusal;

namespace {

constexpr std::size_t kSmallBody = 65536;
constexpr std::size_t kLargestPicture = std::size_t(32) << 20;
constexpr std::size_t kMostSides = 2;
constexpr int kThumbnailWidth = 160, kReferenceWidth = 1600;
constexpr int kPhotoQuality = 92, kThumbnailQuality = 82;
constexpr std::uint8_t kReachAlpha = 200;
const std::vector<std::string> kOrders = {"colour",    "stop",   "keep", "begin",      "rename",
                                          "duplicate", "delete", "bake", "photographs"};

std::string text_of(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// A whole number; nothing where the text is none.
std::optional<int> number_in(std::string_view text) {
  int value = 0;
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
  return failure == std::errc() && end == text.data() + text.size() && value >= 0 ? std::optional(value) : std::nullopt;
}

/// Strokes that are not saved yet, of one view.
struct ReachMessage {
  int view = 0;
  std::vector<Stroke> strokes;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("view", self.view);
    v("strokes", self.strokes);
  }
};

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

Picture grey_of(const MonoImage& image) {
  std::vector<float> light(image.pixel_count());
  for (std::size_t p = 0; p < light.size(); ++p) light[p] = image.stored_luminance(p);
  return picture_from_linear(image.width, image.height, light);
}

}  // namespace

struct Studio::Route {
  std::string method, path;  ///< one that ends with / goes on with a number
  std::size_t largest_body;
  Handler handler;

  [[nodiscard]] bool is_for(const std::string& wanted, const std::string& address) const {
    if (method != wanted) return false;
    return path.ends_with('/') ? address.starts_with(path) && number_in(address.substr(path.size())).has_value()
                               : address == path;
  }
};

const std::vector<Studio::Route>& Studio::routes() {
  static const std::vector<Route> routes = {
      {"GET", "/studio/scene", 0, &Studio::get_scene},
      {"GET", "/studio/state", 0, &Studio::get_state},
      {"GET", "/studio/events", 0, &Studio::get_state},
      {"GET", "/studio/photos/", 0, &Studio::get_photo},
      {"GET", "/studio/thumbnails/", 0, &Studio::get_thumbnail},
      {"GET", "/studio/strokes", 0, &Studio::get_strokes},
      {"PUT", "/studio/strokes", kLargestStrokeFile, &Studio::put_strokes},
      {"GET", "/studio/reach/", 0, &Studio::get_reach},
      {"POST", "/studio/reach", kLargestStrokeFile, &Studio::post_reach},
      {"POST", "/studio/frame", kSmallBody, &Studio::post_frame},
      {"POST", "/studio/orders", kSmallBody, &Studio::post_order},
      {"POST", "/studio/pictures", kLargestPicture, &Studio::post_picture},
      {"GET", "/studio/files/", 0, &Studio::get_file},
  };
  return routes;
}

std::optional<std::size_t> Studio::largest_body(const std::string& method, const std::string& path) const {
  for (const Route& route : routes()) {
    if (route.is_for(method, path)) return route.largest_body;
  }
  return std::nullopt;
}

PageAnswer Studio::answer(const PageRequest& request) {
  const auto route =
      std::ranges::find_if(routes(), [&](const Route& one) { return one.is_for(request.method, request.path); });
  if (route == routes().end()) return refusal(404, "not here");
  try {
    return (this->*route->handler)(request);
  } catch (const MissingInputError& problem) {
    return refusal(404, problem.what());
  } catch (const Error& problem) {
    return refusal(problem.exit_code() == ExitCode::kOutput ? 507 : 400, problem.what());
  }
}

// ---- looking ------------------------------------------------------------------------------------------------------

PageAnswer Studio::get_scene(const PageRequest& /*request*/) {
  return {.body = scene_};
}

PageAnswer Studio::get_state(const PageRequest& /*request*/) {
  const std::lock_guard lock(mutex_);
  return {.body = json_of(state_).dump()};
}

/// Number of the view at the end of the path.  @throws MissingInputError
std::size_t Studio::view_in(const PageRequest& request) const {
  const auto number = number_in(std::string_view(request.path).substr(request.path.rfind('/') + 1));
  if (!number || std::size_t(*number) >= context_.capture.views.size()) {
    throw MissingInputError("the capture has " + std::to_string(context_.capture.views.size()) + " views");
  }
  return std::size_t(*number);
}

PageAnswer Studio::get_photo(const PageRequest& request) {
  Picture picture = grey_of(context_.capture.views[view_in(request)].image);
  const auto wanted = request.parameters.find("side");
  if (wanted != request.parameters.end()) {
    const int side = std::max(number_in(wanted->second).value_or(0), 16);
    const double factor = std::min(1.0, double(side) / std::max(picture.width, picture.height));
    picture = scaled_down(picture, std::max(1, int(picture.width * factor)));
  }
  return {.type = "image/jpeg", .body = text_of(jpeg_bytes(picture, kPhotoQuality))};
}

PageAnswer Studio::get_thumbnail(const PageRequest& request) {
  const View& view = context_.capture.views[view_in(request)];
  bool is_ready = false;
  {
    const std::lock_guard lock(mutex_);
    is_ready = state_.ready;
  }
  if (view.held_out || !is_ready) {
    const Picture grey = scaled_down(grey_of(view.image), kThumbnailWidth);
    return {.type = "image/jpeg", .body = text_of(jpeg_bytes(grey, kThumbnailQuality))};
  }
  const auto names = coloring_.names();
  const auto cached = std::size_t(std::ranges::find(names, view.name) - names.begin());
  // Each thumbnail is a client of its own, so that none makes another stale.
  auto drawn = frames_.ask(request.client + " thumbnail " + view.name, [this, cached](const auto&) {
    const Picture picture = draw_cached(coloring_.seen()->views()[cached], coloring_.now(), kThumbnailWidth);
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
  };
  const auto seen = std::make_shared<Seen>();
  auto drawn = frames_.ask(request.client, [this, message, seen](const std::function<bool()>& keep_going) {
    {
      const std::lock_guard lock(mutex_);
      seen->colors = state_.colors;
    }
    const Stopwatch watch;
    std::string jpeg = this->drawn(message, keep_going);
    seen->seconds = watch.seconds();
    return jpeg.empty() ? std::nullopt : std::optional(std::move(jpeg));
  });
  if (!drawn) return {.status = 204};
  return {.type = "image/jpeg",
          .body = std::move(*drawn),
          .headers = {{"X-Cnerf-Colors", std::to_string(seen->colors)},
                      {"X-Cnerf-Milliseconds", fmt::format("{:.1f}", 1000 * seen->seconds)}}};
}

// ---- painting -----------------------------------------------------------------------------------------------------

PageAnswer Studio::get_strokes(const PageRequest& /*request*/) {
  const std::lock_guard lock(mutex_);
  return {.body = json_of(strokes_).dump()};
}

PageAnswer Studio::put_strokes(const PageRequest& request) {
  StrokeList list = strokes_of_json(request.body, "strokes", paintable_views(context_.capture));
  if (!request.revision) return refusal(428, "the header X-Cnerf-Revision is missing");
  const std::lock_guard lock(mutex_);
  if (!state_.writer.empty() && state_.writer != request.client) return refusal(423, "another tab paints");
  if (*request.revision != strokes_.revision) return refusal(409, "another tab was faster");
  list.revision = strokes_.revision + 1;
  write_strokes(context_.directory.root() / "strokes" / kStrokeFile, list);
  become_writer(request.client);
  strokes_ = std::move(list);
  state_.strokes = strokes_.revision;
  ++state_.version;
  news_.notify_all();
  return {.body = nlohmann::json{{"revision", strokes_.revision}}.dump()};
}

/// Under the lock. Only who listens can be noticed when it leaves.
void Studio::become_writer(const std::string& client) {
  if (followers_.contains(client)) state_.writer = client;
}

PageAnswer Studio::get_reach(const PageRequest& request) {
  return reach_of(view_in(request), saved_strokes().strokes);
}

PageAnswer Studio::post_reach(const PageRequest& request) {
  const auto message = record_of<ReachMessage>(parse_json(request.body, "reach"), "reach");
  std::vector<std::string> names;
  for (const View& view : context_.capture.views) names.push_back(view.name);
  StrokeList added;
  added.strokes = message.strokes;
  // As those of a file are.
  const StrokeList checked = strokes_of_json(json_of(added).dump(), "reach", names);
  if (message.view < 0 || std::size_t(message.view) >= names.size()) throw MissingInputError("no such view");
  std::vector<Stroke> strokes = saved_strokes().strokes;
  for (const Stroke& stroke : checked.strokes) {
    std::erase_if(strokes, [&](const Stroke& saved) { return saved.id == stroke.id; });
    strokes.push_back(stroke);
  }
  return reach_of(std::size_t(message.view), strokes);
}

PageAnswer Studio::reach_of(std::size_t view, const std::vector<Stroke>& strokes) {
  {
    const std::lock_guard lock(mutex_);
    if (!state_.ready) return refusal(503, "the views are being looked at; in a moment");
  }
  const View& wanted = context_.capture.views[view];
  if (wanted.held_out) throw MissingInputError(wanted.name + " is held out for evaluation");
  const SeenSurfaces& seen = *coloring_.seen();
  const std::size_t cached = seen.view_named(wanted.name);
  const KnownColorSources sources(seen, known_of(strokes, seen.views(), coloring_.names()));
  const CachedView& shown = seen.views()[cached];
  const cv::Mat overlay = colors_at_luminance(sources.seen_in(cached), {shown.width, shown.height}, kReachAlpha,
                                              [&](std::size_t p) { return shown.luminance[p]; });
  return {.type = "image/png", .body = text_of(png_bytes(overlay))};
}

// ---- orders -------------------------------------------------------------------------------------------------------

PageAnswer Studio::post_order(const PageRequest& request) {
  const auto order = record_of<OrderMessage>(parse_json(request.body, "order"), "order");
  if (std::ranges::find(kOrders, order.order) == kOrders.end()) {
    throw InputError("order", "order", "this studio cannot do " + excerpt(nlohmann::ordered_json(order.order)));
  }
  return take_order(request, {order, {}});
}

/// A photograph to colour like. It is checked like any file, and stays in the run.
PageAnswer Studio::post_picture(const PageRequest& request) {
  const auto parameter = [&](const char* name) {
    const auto found = request.parameters.find(name);
    return found == request.parameters.end() ? std::string() : found->second;
  };
  if (parameter("kind") != "reference") return refusal(400, "kind: this studio takes reference pictures only");
  const fs::path folder = context_.directory.root() / "strokes" / "references";
  const fs::path file = folder / (sha256(std::as_bytes(std::span(request.body))).substr(0, 12) + ".png");
  const LinearImage image = decoded_image(request.body, folder, parameter("name").substr(0, 80));
  if (is_monochrome(image)) throw InputError("picture", "colour", "a reference must be in colour; this one is grey");
  const Picture picture = scaled_down(picture_from_linear(image.width, image.height, image.values), kReferenceWidth);
  write_file(file, png_bytes(picture));
  Order order{{}, file};
  order.message.order = "reference";
  return take_order(request, order);
}

PageAnswer Studio::get_file(const PageRequest& request) {
  const auto number = std::size_t(*number_in(std::string_view(request.path).substr(request.path.rfind('/') + 1)));
  const std::lock_guard lock(mutex_);
  if (number >= downloads_.size()) throw MissingInputError("not here");
  return {.headers = {{"Content-Disposition", "attachment"}}, .file = downloads_[number]};
}

PageAnswer Studio::take_order(const PageRequest& request, const Order& order) {
  const std::lock_guard lock(mutex_);
  if (!state_.writer.empty() && state_.writer != request.client) return refusal(423, "another tab paints");
  become_writer(request.client);
  if (order.message.order == "stop") {
    stop_requested_ = true;
  } else if (is_working_ || order_) {
    return refusal(409, "wait until it is done: " + state_.task);
  } else {
    order_ = order;
    state_.task = order.message.order;
    state_.message.clear();
    state_.failed = false;
    ++state_.version;
    work_.notify_all();
    news_.notify_all();
  }
  return {.status = 202, .body = json_of(state_).dump()};
}

}  // namespace cnerf::studio
