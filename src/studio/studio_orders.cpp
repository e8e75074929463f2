/// The studio's orders: colours, takes, and what is written of them.

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <future>
#include <string_view>

#include "export/manifest.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/process.h"
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
constexpr const char* kRecolor = "recolour";
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
std::vector<std::string> finish_words(const Finish& finish) {
  if (finish.is_plain()) return {};
  return {"--set", fmt::format("finish.saturation={:g}", finish.saturation),
          "--set", fmt::format("finish.hue={:g}", finish.hue),
          "--set", fmt::format("finish.exposure={:g}", finish.exposure)};
}

/// A line for a shell, quoted only where that is needed.
std::string shell_line(const std::vector<std::string>& words) {
  const auto is_plain = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 ||
           std::string_view("-_./,:=+@%").find(c) != std::string_view::npos;
  };
  std::vector<std::string> typed;
  for (const std::string& word : words) {
    typed.push_back(!word.empty() && std::ranges::all_of(word, is_plain) ? word : shell_word(word));
  }
  return cnerf::joined(typed);
}

/// What --take calls a take; nothing where that would be grey, and another is called so.
std::optional<std::string> name_for_commands(const pipeline::RunDirectory& directory, const std::string& take) {
  const std::string name = take.empty() ? pipeline::kGreyTake : take;
  return directory.choose_take(name) == take ? std::optional(name) : std::nullopt;
}

/// What a capture's prepare.json says of where it came from.
struct PreparedOf {
  std::string source;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("source", self.source, kOptional);
  }
};

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
  {
    const std::lock_guard lock(mutex_);
    board_.change([](StateMessage& state) { state.ready = true; });
  }
  color_again();
}

/// What no take held when the last studio ended.
void Studio::color_again() {
  const fs::path file = stroke_folder(context_) / kNowFile;
  if (!fs::exists(file)) return;
  if (!goes_on_) {
    return observer_.say("note: " + file.string() + ": colours that no take holds; without --take they are made again");
  }
  observer_.say("colours that no take holds are made again");
  begin_pace();
  try {
    coloring_->replay(read_journal(file, paintable_views(context_.capture)), retouch_,
                      [this](double fraction) { breathe_in_color(kRecolor, fraction); });
  } catch (const Interrupted&) {
    throw;  // they can still be made
  } catch (const Error& problem) {
    return set_now_aside(problem.what());
  }
  owns_now_ = true;
  colors_changed();
  board_.say("what no take holds was coloured again");
}

/// So that it is in nobody's way, and lost to nobody.
void Studio::set_now_aside(const std::string& why) {
  const fs::path file = stroke_folder(context_) / kNowFile;
  fs::path aside;
  for (int i = 1; fs::exists(aside = file.parent_path() / fmt::format("now-{}.json", i));) ++i;
  std::error_code failure;
  fs::rename(file, aside, failure);
  if (failure) throw OutputError(file.string() + ": cannot be renamed: " + failure.message());
  const std::string note = "note: colours that no take holds are left aside as " + aside.string() + ": " + why;
  observer_.say(note);
  board_.note(note);
}

/// A kill, or the end of the program, does not lose it then.
void Studio::save_now() {
  if (!coloring_->is_unkept()) return;
  const fs::path file = stroke_folder(context_) / kNowFile;
  if (!owns_now_ && fs::exists(file)) set_now_aside("others were painted, and these were not made again");
  write_journal(file, coloring_->journal());
  owns_now_ = true;
}

/// Colours that a take holds by now, or that were left.
void Studio::forget_now() {
  if (std::exchange(owns_now_, false)) remove_output(stroke_folder(context_) / kNowFile);
}

void Studio::breathe_in_color(const char* task, double fraction) {
  if (pace_.is_due(since_begun_.seconds())) colors_changed();
  breathe(task, fraction);
}

void Studio::begin_pace() {
  since_begun_ = {};
  pace_ = {};
}

void Studio::colour(const Order& /*order*/) {
  const StrokeList list = saved_strokes();
  // Colours do not wait for them.
  std::future<void> pictures = std::async(
      std::launch::async, [&] { write_paint_pictures(stroke_folder(context_), context_.capture, list.strokes); });
  begin_pace();
  try {
    coloring_->colour(list, retouch_, [this](double fraction) { breathe_in_color("colour", fraction); });
  } catch (...) {
    save_now();
    throw;
  }
  save_now();
  colors_changed();
  pictures.get();
  board_.say(fmt::format("settled in {:.0f} s", since_begun_.seconds()));
  // What began from a take is repeated once it is kept, by its journal.
  if (!coloring_->base_name().empty()) return;
  add_command("colorize", {"--take", context_.directory.free_take_name("painted"), "--colorizer", "grey", "--strokes",
                           stroke_folder(context_) / kStrokeFile});
}

void Studio::keep(const Order& order) {
  check_new_name(order.message.name);
  keep_as(order.message.name);
  board_.say("kept as take " + order.message.name);
}

/// "Now" as a take.
void Studio::keep_as(const std::string& take) {
  coloring_->keep(take, 0, observer_);
  forget_now();
  write_strokes_whole(context_.directory.take_folder(take), saved_strokes(), painted_);
  add_command("colorize", {"--replay", take});
}

void Studio::begin(const Order& order) {
  const std::string& take = order.message.take;
  begin_from(take.empty() ? "" : context_.directory.choose_take(take));
  board_.say(take.empty() ? "grey again" : "begun from take " + take);
}

/// What no take holds is left.
void Studio::begin_from(const std::string& take) {
  coloring_->begin(take);
  forget_now();
  colors_changed();
}

std::string Studio::colorize(const ColorizerOptions& colorizer, const std::vector<int>& bases) {
  const ConfigInstead config(*this, [&](Config& changed) {
    changed.colorizer = colorizer;
    changed.stage2.purify.picked_bases = numbers_text(bases);
  });
  const std::string take = context_.directory.free_take_name(colorizer.spec.substr(0, colorizer.spec.find(':')));
  coloring_->cache_views([this](double fraction) { breathe("cache", fraction); });
  // It saves what it has before it stops, so nothing is thrown between its steps; before these a colorizer is fitted.
  bool is_training = false;
  const auto between = [&] {
    if (!is_training) draw_frames();
  };
  BoardObserver observer(board_, observer_, "colour", between, [this] { return should_stop(); });
  const auto watch = [&](const ColorModel& model) {
    is_training = true;
    watch_colors(model);
  };
  begin_pace();
  pipeline::colorize_step(context_, {take, {}, nullptr, &coloring_->cached_views(), watch}, engines_, observer);
  begin_from(take);
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
  add_command("colorize", {"--colorizer", colorizer.spec});
}

void Studio::color_by_network(const Order& order) {
  ColorizerOptions colorizer;
  colorizer.spec = kBuiltin;
  const std::string take = colorize(colorizer, order.message.bases);
  board_.say("coloured by the built-in network, take " + take);
  std::vector<std::string> words = {"--colorizer", colorizer.spec};
  if (!order.message.bases.empty()) words.insert(words.end(), {"--bases", numbers_text(order.message.bases)});
  add_command("colorize", words);
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
    messages.push_back({int(cards.size()), fmt::format("./studio/cards/{}", cards.size())});
    cards.push_back(text_of(jpeg_bytes(tile.picture, kCardQuality)));
  }
  add_command("colorize", {"--colorizer", kBuiltin, "--bases-only"});
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
  if (const auto name = name_for_commands(context_.directory, job.take)) {
    add_command("colorize", {"--take", *name, "--suggest-keyframes", std::to_string(kSuggestedViews)});
  }
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
  keep_as(take);
  return take;
}

// ---- what is written ----------------------------------------------------------------------------------------------

void Studio::bake(const Order& order) {
  const std::string formats = cnerf::joined(order.message.formats, ",");
  const exporting::Formats wanted = exporting::parse_formats(formats);
  const std::string take = take_of_now();
  const fs::path folder = context_.directory.bakes(take);
  const ConfigInstead config(*this, [this](Config& changed) { changed.finish = finish(); });
  BoardObserver observer = observer_of("bake");
  pipeline::bake_step(context_, {take, folder, wanted}, engines_, observer);
  std::vector<fs::path> files;
  if (wanted.has_manifest()) {  // a web bundle alone has none, and leaves that of an earlier bake
    const exporting::BakeManifest manifest = exporting::read_manifest(exporting::last_file(folder, wanted));
    for (const std::string& file : manifest.files) {
      const std::string kind = fs::path(file).extension();
      if (kind == ".vdb" || kind == ".glb" || kind == ".exr") files.push_back(folder / file);
    }
  }
  std::ranges::sort(files);
  offer_downloads(files);
  board_.change([&](StateMessage& state) {
    state.message = "baked to " + folder.string();
    if (wanted.is_for_blender()) state.blender = shell_line({"blender", "--python", folder / "blender_setup.py"});
  });
  if (const auto name = name_for_commands(context_.directory, take)) {
    add_command("bake", {"--take", *name, "--format", formats}, finish_words(context_.config.finish));
  }
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
  add_command("render", {"--take", take, "--photographs", "--format", format}, finish_words(context_.config.finish));
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

// ---- commands -----------------------------------------------------------------------------------------------------

void Studio::add_command(const std::string& command, std::vector<std::string> words,
                         const std::vector<std::string>& more) {
  words.insert(words.begin(), {"cnerf", command, context_.directory.root()});
  words.insert(words.end(), more.begin(), more.end());
  add_line(words);
}

void Studio::add_line(const std::vector<std::string>& words) {
  board_.change([line = shell_line(words)](StateMessage& state) { state.commands.push_back(line); });
}

void Studio::add_lines_of_training() {
  const fs::path capture = context_.directory.record().capture, origin = capture / "prepare.json";
  if (fs::exists(origin)) {
    if (const auto prepared = read_record<PreparedOf>(origin); !prepared.source.empty()) {
      add_line({"cnerf", "prepare", prepared.source, "-o", capture});
    }
  }
  add_line({"cnerf", "train", capture, "-o", context_.directory.root(), "--config", context_.directory.config_file()});
}

// ---- takes --------------------------------------------------------------------------------------------------------

void Studio::duplicate_take(const Order& order) {
  const auto& [take, name] = std::tie(order.message.take, order.message.name);
  check_new_name(name);
  duplicate(context_.directory, take, name, observer_);
  board_.say("take " + take + " is take " + name + " too");
}

void Studio::rename_take(const Order& order) {
  const auto& [take, name] = std::tie(order.message.take, order.message.name);
  check_new_name(name);
  rename(context_.directory, take, name, observer_);
  shown_takes_.erase(take);
  coloring_->take_is_called(take, name);
  board_.say("take " + take + " is called " + name + " now");
}

void Studio::delete_take(const Order& order) {
  const std::string& take = order.message.take;
  if (take == coloring_->base_name()) throw UsageError("what is shown now was begun from take " + take);
  const bool held_now = take == coloring_->kept_as();
  remove(context_.directory, take, "", observer_);
  shown_takes_.erase(take);
  coloring_->take_is_called(take, "");
  if (held_now) save_now();
  board_.say("take " + take + " is gone");
}

}  // namespace cnerf::studio
