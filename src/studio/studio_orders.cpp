/// The studio's orders: colours, takes, and what is written of them.

#include <fmt/format.h>

#include <algorithm>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/text.h"
#include "src/picture/encode.h"
#include "src/pipeline/bake_step.h"
#include "src/pipeline/colorize_step.h"
#include "src/pipeline/key_views_step.h"
#include "src/pipeline/photographs_step.h"
#include "src/studio/paint_files.h"
#include "src/studio/studio.h"

namespace cnerf::studio {
namespace fs = std::filesystem;
namespace {

constexpr int kCardQuality = 88;
constexpr const char* kBuiltin = "builtin";
constexpr const char* kKeyViews = "key-views";
constexpr int kSuggestedViews = 3;

/// Sides of pictures have names too.
void check_new_name(const std::string& name) {
  pipeline::check_take_name(name);
  if (name == kNow || name == pipeline::kGreyTake) throw UsageError("no take can be called " + name);
}

std::string numbers_text(const std::vector<int>& numbers) {
  std::vector<std::string> words;
  for (const int number : numbers) words.push_back(std::to_string(number));
  return cnerf::joined(words, ",");
}

/// As settings of a command.
std::string finish_text(const Finish& finish) {
  return finish.is_plain()
             ? ""
             : fmt::format(" --set finish.saturation={:g} --set finish.hue={:g} --set finish.exposure={:g}",
                           finish.saturation, finish.hue, finish.exposure);
}

}  // namespace

/// The run's configuration changed for one job. Only the working thread reads it.
class Studio::ConfigInstead {
 public:
  ConfigInstead(Studio& studio, const std::function<void(Config&)>& change)
      : config_(studio.context_.config), own_(config_) {
    change(config_);
  }
  ~ConfigInstead() { config_ = std::move(own_); }
  ConfigInstead(const ConfigInstead&) = delete;
  ConfigInstead& operator=(const ConfigInstead&) = delete;

 private:
  Config& config_;
  Config own_;
};

struct Studio::OrderKind {
  const char* name;
  void (Studio::*handler)(const Order&);
  bool is_of_pages = true, needs_field = true;
};

std::span<const Studio::OrderKind> Studio::order_kinds() {
  static const OrderKind kinds[] = {
      {"train", &Studio::train, true, false},
      {"cache", &Studio::cache_views, false},
      {"colour", &Studio::colour},
      {"keep", &Studio::keep},
      {"begin", &Studio::begin},
      {"rename", &Studio::rename_take},
      {"duplicate", &Studio::duplicate_take},
      {"delete", &Studio::delete_take},
      {"suggest", &Studio::suggest},
      {kKeyViews, &Studio::suggest_views},
      {kBuiltin, &Studio::color_by_network},
      {"reference", &Studio::color_by_reference, false},
      {"bake", &Studio::bake},
      {"photographs", &Studio::write_photographs},
  };
  return kinds;
}

void Studio::carry_out(const Order& order) {
  const auto kind = std::ranges::find(order_kinds(), order.message.order, &OrderKind::name);
  if (kind->needs_field && !coloring_) throw UsageError("the scene is not trained yet");
  (this->*kind->handler)(order);
}

bool Studio::is_order_of_pages(const std::string& name) {
  const auto kind = std::ranges::find(order_kinds(), name, &OrderKind::name);
  return kind != order_kinds().end() && kind->is_of_pages;
}

// ---- colours ------------------------------------------------------------------------------------------------------

void Studio::cache_views(const Order& /*order*/) {
  coloring_->cache_views([this](double fraction) { breathe("cache", fraction); });
  const std::lock_guard lock(mutex_);
  board_.change([](StateMessage& state) { state.ready = true; });
}

void Studio::begin_pace() {
  since_begun_ = {};
  pace_ = {};
}

void Studio::colour(const Order& /*order*/) {
  const StrokeList list = saved_strokes();
  write_paint_pictures(stroke_folder(context_), context_.capture, list.strokes);
  begin_pace();
  coloring_->colour(list, retouch_, [&](double fraction) {
    if (pace_.is_due(since_begun_.seconds())) colors_changed();
    breathe("colour", fraction);
  });
  colors_changed();
  board_.say(fmt::format("settled in {:.0f} s", since_begun_.seconds()));
  add_command(fmt::format("cnerf colorize {}{} --strokes {}", context_.directory.root().string(),
                          coloring_->base_name().empty() ? " --colorizer grey" : "",
                          (stroke_folder(context_) / kStrokeFile).string()));
}

void Studio::keep(const Order& order) {
  const std::string& name = order.message.name;
  check_new_name(name);
  coloring_->keep(name, 0, observer_);
  write_strokes_whole(context_.directory.take_folder(name), saved_strokes(), painted_);
  board_.say("kept as take " + name);
}

void Studio::begin(const Order& order) {
  const std::string& take = order.message.take;
  coloring_->begin(context_.directory.choose_take(take.empty() ? pipeline::kGreyTake : take));
  board_.say(take.empty() ? "grey again" : "begun from take " + take);
  colors_changed();
}

std::string Studio::colorize(const ColorizerOptions& colorizer, const std::vector<int>& bases) {
  const ConfigInstead config(*this, [&](Config& changed) {
    changed.colorizer = colorizer;
    changed.stage2.purify.picked_bases = numbers_text(bases);
  });
  const std::string take = context_.directory.free_take_name(colorizer.spec.substr(0, colorizer.spec.find(':')));
  coloring_->cache_views([this](double fraction) { breathe("cache", fraction); });
  // It saves what it has before it stops, so nothing is thrown between its steps.
  BoardObserver observer(
      board_, observer_, "colour", [] {}, [this] { return should_stop(); });
  const auto watch = [this](const ColorModel& model) { watch_colors(model); };
  begin_pace();
  pipeline::colorize_step(context_, {take, {}, nullptr, &coloring_->cached_views(), watch}, engines_, observer);
  coloring_->begin(take);
  colors_changed();
  return take;
}

void Studio::watch_colors(const ColorModel& model) {
  learning_ = &model;
  draw_frames();
  learning_ = nullptr;
  if (pace_.is_due(since_begun_.seconds())) colors_changed();
}

void Studio::color_by_reference(const Order& order) {
  ColorizerOptions colorizer;
  colorizer.spec = "reference:" + order.picture.string();
  const std::string take = colorize(colorizer, {});
  board_.say("coloured like " + order.picture.filename().string() + ", take " + take);
  add_command("cnerf colorize " + context_.directory.root().string() + " --colorizer " + colorizer.spec);
}

void Studio::color_by_network(const Order& order) {
  ColorizerOptions colorizer;
  colorizer.spec = kBuiltin;
  const std::string take = colorize(colorizer, order.message.bases);
  board_.say("coloured by the built-in network, take " + take);
  const std::string bases = numbers_text(order.message.bases);
  add_command("cnerf colorize " + context_.directory.root().string() + " --colorizer " + colorizer.spec +
              (bases.empty() ? "" : " --bases " + bases));
}

void Studio::suggest(const Order& /*order*/) {
  const ConfigInstead config(*this, [](Config& changed) {
    changed.colorizer = {};
    changed.colorizer.spec = kBuiltin;
  });
  BoardObserver observer = observer_of("suggest");
  std::vector<std::string> cards;
  std::vector<CardMessage> messages;
  for (const Tile& tile : pipeline::base_candidates(context_, &coloring_->cached_views(), engines_, observer)) {
    const std::vector<std::byte> bytes = jpeg_bytes(tile.picture, kCardQuality);
    messages.push_back({int(cards.size()), fmt::format("./studio/cards/{}", cards.size())});
    cards.emplace_back(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  }
  add_command("cnerf colorize " + context_.directory.root().string() + " --colorizer builtin --bases-only");
  const std::lock_guard lock(mutex_);
  cards_ = std::move(cards);
  board_.change([&](StateMessage& state) {
    state.cards = std::move(messages);
    state.message = "choose those that you like";
  });
}

/// What is painted counts as coloured, and the doubts of a take where that is what is shown.
void Studio::suggest_views(const Order& /*order*/) {
  coloring_->cache_views([this](double fraction) { breathe(kKeyViews, fraction); });
  const std::vector<View>& views = context_.capture.views;
  pipeline::KeyViewsJob job{kSuggestedViews, coloring_->kept_as(), &coloring_->cached_views()};
  for (const Stroke& stroke : saved_strokes().strokes) {
    const bool is_photograph = std::ranges::find(views, stroke.view, &View::name) != views.end();
    if (!stroke.hidden && is_photograph) job.given.push_back(stroke.view);
  }
  BoardObserver observer = observer_of(kKeyViews);
  const pipeline::KeyViews found = suggested_key_views(context_, job, engines_, observer);
  std::vector<KeyViewMessage> messages;
  for (const pipeline::SuggestedView& one : found.suggested) {
    messages.push_back({int(std::ranges::find(views, one.view, &View::name) - views.begin()), one.adds});
  }
  add_command(
      fmt::format("cnerf colorize {} --suggest-keyframes {}", context_.directory.root().string(), kSuggestedViews));
  const std::lock_guard lock(mutex_);
  board_.change([&](StateMessage& state) {
    state.message = messages.empty() ? "every view is painted on" : "begin with the photographs that are marked";
    state.key_views = std::move(messages);
  });
}

std::string Studio::take_of_now() {
  if (coloring_->now() == nullptr) return "";
  if (!coloring_->is_unkept()) return coloring_->kept_as();
  const std::string take = context_.directory.free_take_name("studio");
  coloring_->keep(take, 0, observer_);
  return take;
}

// ---- what is written ----------------------------------------------------------------------------------------------

void Studio::bake(const Order& order) {
  const std::vector<std::string>& formats = order.message.formats;
  const exporting::Formats wanted = exporting::parse_formats(cnerf::joined(formats, ","));
  const std::string take = take_of_now();
  const fs::path folder = context_.directory.bakes(take);
  const ConfigInstead config(*this, [this](Config& changed) { changed.finish = finish(); });
  BoardObserver observer = observer_of("bake");
  pipeline::bake_step(context_, {take, folder, wanted}, engines_, observer);
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string kind = entry.path().extension();
    if (kind == ".vdb" || kind == ".glb" || kind == ".exr") files.push_back(entry.path());
  }
  std::ranges::sort(files);
  offer_downloads(files);
  board_.change([&](StateMessage& state) {
    state.message = "baked to " + folder.string();
    if (wanted.is_for_blender()) state.blender = "blender --python " + (folder / "blender_setup.py").string();
  });
  add_command("cnerf bake " + context_.directory.root().string() + (take.empty() ? "" : " --take " + take) +
              " --format " + cnerf::joined(formats, ",") + finish_text(context_.config.finish));
}

void Studio::write_photographs(const Order& order) {
  const std::string& format = order.message.format;
  const std::string take = take_of_now();
  pipeline::check_photographs_take(context_.directory, take);
  const fs::path folder = pipeline::photographs_folder(context_.directory, take);
  const ConfigInstead config(*this, [this](Config& changed) { changed.finish = finish(); });
  BoardObserver observer = observer_of("photographs");
  offer_downloads(pipeline::photographs_step(context_, {take, {}, folder, pipeline::photograph_format_named(format)},
                                             engines_, observer));
  board_.say("photographs in " + folder.string());
  add_command("cnerf render " + context_.directory.root().string() + " --take " + take + " --photographs --format " +
              format + finish_text(context_.config.finish));
}

/// Those of earlier work go: their files may have been replaced.
void Studio::offer_downloads(const std::vector<fs::path>& files) {
  std::vector<DownloadMessage> downloads;
  for (const fs::path& file : files) {
    std::error_code failure;
    const auto bytes = fs::file_size(file, failure);
    downloads.push_back({file.filename().string(), fmt::format("./studio/files/{}", downloads.size()),
                         failure ? 0 : std::uint64_t(bytes)});
  }
  const std::lock_guard lock(mutex_);
  downloads_ = files;
  board_.change([&](StateMessage& state) { state.downloads = std::move(downloads); });
}

// ---- takes --------------------------------------------------------------------------------------------------------

std::vector<TakeMessage> Studio::list_takes() const {
  std::vector<TakeMessage> takes;
  std::error_code failure;
  for (const auto& entry : fs::directory_iterator(context_.directory.root() / "takes", failure)) {
    const std::string name = entry.path().filename().string();
    if (const auto record = context_.directory.take_record(name)) {
      takes.push_back({name, record->colorizer, record->stage2.seconds});
    }
  }
  std::ranges::sort(takes, {}, &TakeMessage::name);
  return takes;
}

void Studio::duplicate_take(const Order& order) {
  const auto& [take, name] = std::tie(order.message.take, order.message.name);
  check_new_name(name);
  duplicate(context_.directory, take, name, observer_);
  board_.say("take " + take + " is take " + name + " too");
}

void Studio::rename_take(const Order& order) {
  const auto& [take, name] = std::tie(order.message.take, order.message.name);
  check_new_name(name);
  duplicate(context_.directory, take, name, observer_);
  remove(context_.directory, take, name, observer_);
  shown_takes_.erase(take);
  coloring_->take_is_called(take, name);
  board_.say("take " + take + " is called " + name + " now");
}

void Studio::delete_take(const Order& order) {
  const std::string& take = order.message.take;
  if (take == coloring_->base_name()) throw UsageError("what is shown now was begun from take " + take);
  remove(context_.directory, take, "", observer_);
  shown_takes_.erase(take);
  coloring_->take_is_called(take, "");
  board_.say("take " + take + " is gone");
}

}  // namespace cnerf::studio
