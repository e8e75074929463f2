#include "src/studio/studio.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/text.h"
#include "src/base/usage.h"
#include "src/picture/encode.h"
#include "src/pipeline/bake_step.h"
#include "src/pipeline/colorize_step.h"
#include "src/pipeline/photographs_step.h"
#include "src/studio/paint_files.h"

namespace cnerf::studio {
namespace fs = std::filesystem;
namespace {

constexpr auto kPoll = std::chrono::milliseconds(50);  // Ctrl-C only sets a flag
constexpr double kBetweenColors = 1.0;                 // seconds: pages draw what changed
constexpr std::size_t kMostTakesInMemory = 3;
constexpr int kJpegQuality = 88;
constexpr const char* kNow = "now";

fs::path stroke_folder(const pipeline::RunContext& context) {
  return context.directory.root() / "strokes";
}

}  // namespace

Studio::Studio(const pipeline::RunContext& context, const std::string& take, const Engines& engines, Observer& observer,
               const RetouchOptions& retouch)
    : context_(context),
      engines_(engines),
      observer_(observer),
      retouch_(retouch),
      run_lock_(pipeline::lock_folder(context.directory.root(), FolderLock::Mode::kShared, observer)),
      lock_(pipeline::lock_folder(stroke_folder(context), FolderLock::Mode::kAlone, observer)),
      scene_(json_of(scene_of(context.capture, context.directory.root().string())).dump()),
      coloring_(context, engines),
      frames_([this] { work_.notify_all(); }) {
  const fs::path file = stroke_folder(context_) / kStrokeFile;
  if (fs::exists(file)) strokes_ = read_strokes(file, paintable_views(context_.capture));
  state_.strokes = strokes_.revision;
  coloring_.begin(take);
  state_.take = take;
  state_.takes = list_takes();
}

Studio::~Studio() {
  close();
}

void Studio::run() {
  Order first;
  first.message.order = "cache";
  work_on(first);
  while (!interruption_requested() && !closed()) {
    frames_.draw_waiting();
    std::optional<Order> order;
    {
      std::unique_lock lock(mutex_);
      work_.wait_for(lock, kPoll, [&] { return order_.has_value() || frames_.has_waiting() || is_closed_; });
      std::swap(order, order_);
      is_working_ = order.has_value();
      stop_requested_ = false;
    }
    if (order) work_on(*order);
  }
}

/// An order that cannot be carried out is told; the studio stays.
void Studio::work_on(const Order& order) {
  try {
    carry_out(order);
  } catch (const Interrupted&) {
    say("stopped; what was done by then stays");
  } catch (const Error& problem) {
    say(problem.what(), true);
  } catch (const std::bad_alloc&) {
    say("the memory does not suffice for this", true);
  }
  std::vector<TakeMessage> takes = list_takes();
  change([&](StateMessage& state) {
    is_working_ = false;
    state.task.clear();
    state.fraction = 0;
    state.takes = std::move(takes);
    state.take = coloring_.base_name();
    state.unkept = coloring_.is_unkept();
  });
}

void Studio::carry_out(const Order& of_page) {
  const OrderMessage& order = of_page.message;
  if (order.order == "cache") {
    coloring_.cache_views([this](double fraction) { breathe("cache", fraction); });
    change([](StateMessage& state) { state.ready = true; });
  } else if (order.order == "colour") {
    colour();
  } else if (order.order == "keep") {
    check_new_name(order.name);
    coloring_.keep(order.name, 0, observer_);
    write_strokes(context_.directory.take_folder(order.name) / kStrokeFile, saved_strokes());
    say("kept as take " + order.name);
  } else if (order.order == "begin") {
    coloring_.begin(context_.directory.choose_take(order.take.empty() ? pipeline::kGreyTake : order.take));
    say(order.take.empty() ? "grey again" : "begun from take " + order.take);
    colors_changed();
  } else if (order.order == "rename") {
    rename_take(order.take, order.name);
  } else if (order.order == "duplicate") {
    duplicate_take(order.take, order.name);
  } else if (order.order == "delete") {
    delete_take(order.take);
  } else if (order.order == "reference") {
    color_by_reference(of_page.picture);
  } else if (order.order == "bake") {
    bake(order.formats);
  } else if (order.order == "photographs") {
    write_photographs(order.format);
  } else {
    throw UsageError("the studio cannot do this yet: " + order.order);
  }
}

void Studio::colour() {
  const std::vector<Stroke> strokes = saved_strokes().strokes;
  write_paint_pictures(stroke_folder(context_), context_.capture, strokes);
  const Stopwatch watch;
  double shown_at = 0;
  coloring_.colour(strokes, retouch_, [&](double fraction) {
    if (watch.seconds() - shown_at > kBetweenColors) {
      shown_at = watch.seconds();
      colors_changed();
    }
    breathe("colour", fraction);
  });
  colors_changed();
  const std::string base = coloring_.base_name();
  change([&](StateMessage& state) {
    state.message = fmt::format("settled in {:.0f} s", watch.seconds());
    state.commands.push_back(fmt::format("cnerf colorize {}{} --strokes {}", context_.directory.root().string(),
                                         base.empty() ? " --colorizer grey" : "",
                                         (stroke_folder(context_) / kStrokeFile).string()));
  });
}

/// Steps of the pipeline, as the studio's page sees them.
class Studio::JobObserver final : public Observer {
 public:
  JobObserver(Studio& studio, std::string task) : studio_(studio), task_(std::move(task)) {}
  void report_progress(const Progress& progress) override {
    studio_.change([&](StateMessage& state) {
      state.figures.clear();
      for (const auto& [name, value] : progress.figures) {
        if (std::isfinite(value)) state.figures[name] = value;
      }
    });
    studio_.breathe(task_, progress.fraction);
  }
  void say(const std::string& text) override { studio_.observer_.say(text); }
  [[nodiscard]] bool is_cancelled() const override { return studio_.should_stop(); }

 private:
  Studio& studio_;
  std::string task_;
};

/// A take as the colorizer `reference:` makes it, then begun from.
void Studio::color_by_reference(const fs::path& picture) {
  pipeline::RunContext context = context_;
  context.config.colorizer = {};
  context.config.colorizer.spec = "reference:" + picture.string();
  const std::string take = context_.directory.free_take_name("reference");
  JobObserver job(*this, "colour");
  coloring_.cache_views([this](double fraction) { breathe("cache", fraction); });
  pipeline::colorize_step(context, {take, {}, nullptr, &coloring_.cached_views()}, engines_, job);
  coloring_.begin(take);
  colors_changed();
  change([&](StateMessage& state) {
    state.message = "coloured like " + picture.filename().string() + ", take " + take;
    state.commands.push_back("cnerf colorize " + context_.directory.root().string() +
                             " --colorizer reference:" + picture.string());
  });
}

std::string Studio::take_of_now() {
  if (coloring_.now() == nullptr) return "";
  if (!coloring_.is_unkept()) return coloring_.kept_as();
  const std::string take = context_.directory.free_take_name("studio");
  coloring_.keep(take, 0, observer_);
  return take;
}

void Studio::bake(const std::vector<std::string>& formats) {
  const exporting::Formats wanted = exporting::parse_formats(cnerf::joined(formats, ","));
  const std::string take = take_of_now();
  const fs::path folder = context_.directory.bakes(take);
  JobObserver job(*this, "bake");
  pipeline::bake_step(context_, {take, folder, wanted}, engines_, job);
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string kind = entry.path().extension();
    if (kind == ".vdb" || kind == ".glb" || kind == ".exr") files.push_back(entry.path());
  }
  std::ranges::sort(files);
  offer_downloads(files);
  change([&](StateMessage& state) {
    state.message = "baked to " + folder.string();
    if (wanted.has_manifest()) state.blender = "blender --python " + (folder / "blender_setup.py").string();
    state.commands.push_back("cnerf bake " + context_.directory.root().string() +
                             (take.empty() ? "" : " --take " + take) + " --format " + cnerf::joined(formats, ","));
  });
}

void Studio::write_photographs(const std::string& format) {
  const std::string take = take_of_now();
  pipeline::check_photographs_take(context_.directory, take);
  const fs::path folder = pipeline::photographs_folder(context_.directory, take);
  JobObserver job(*this, "photographs");
  offer_downloads(pipeline::photographs_step(context_, {take, {}, folder, pipeline::photograph_format_named(format)},
                                             engines_, job));
  change([&](StateMessage& state) {
    state.message = "photographs in " + folder.string();
    state.commands.push_back("cnerf render " + context_.directory.root().string() + " --take " + take +
                             " --photographs --format " + format);
  });
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
  change([&](StateMessage& state) {
    downloads_ = files;
    state.downloads = std::move(downloads);
  });
}

/// Between two pieces of work: pages want frames, and users may have had enough.
void Studio::breathe(const std::string& task, double fraction) {
  change([&](StateMessage& state) {
    state.task = task;
    state.fraction = fraction;
  });
  frames_.draw_waiting();
  if (should_stop()) throw Interrupted("stopped");
}

bool Studio::should_stop() const {
  const std::lock_guard lock(mutex_);
  return stop_requested_ || is_closed_ || interruption_requested();
}

// ---- pictures -----------------------------------------------------------------------------------------------------

const ColorModel* Studio::side_named(const std::string& name) {
  if (name == pipeline::kGreyTake) return nullptr;
  if (name == kNow) return coloring_.now();
  const auto found = shown_takes_.find(name);
  if (found != shown_takes_.end()) return found->second.get();
  pipeline::check_take_name(name);
  if (!context_.directory.take_record(name)) throw MissingInputError("there is no take " + name);
  if (shown_takes_.size() >= kMostTakesInMemory) shown_takes_.clear();
  auto model = std::make_unique<ColorModel>(ColorModel::load(context_.directory.take_snapshot(name), engines_));
  return (shown_takes_[name] = std::move(model)).get();
}

std::string Studio::drawn(const FrameMessage& message, const std::function<bool()>& keep_going) {
  std::vector<Side> sides;
  for (const std::string& name : message.sides) sides.push_back(side_named(name));
  const std::vector<Picture> pictures = draw_field(coloring_.luminance(), camera_of(message), sides,
                                                   sharp_effort(context_.config.render.steps_per_box), keep_going);
  if (pictures.empty()) return {};
  Picture all = pictures.front();
  for (std::size_t s = 1; s < pictures.size(); ++s) {
    all.rgb.insert(all.rgb.end(), pictures[s].rgb.begin(), pictures[s].rgb.end());
    all.height += pictures[s].height;
  }
  const std::vector<std::byte> bytes = jpeg_bytes(all, kJpegQuality);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
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

/// Sides of pictures have names too.
void Studio::check_new_name(const std::string& name) {
  pipeline::check_take_name(name);
  if (name == kNow || name == pipeline::kGreyTake) throw UsageError("no take can be called " + name);
}

void Studio::duplicate_take(const std::string& take, const std::string& name) {
  check_new_name(name);
  const pipeline::RunDirectory& directory = context_.directory;
  duplicate(directory, take, name, observer_);
  say("take " + take + " is take " + name + " too");
}

void Studio::rename_take(const std::string& take, const std::string& name) {
  check_new_name(name);
  duplicate(context_.directory, take, name, observer_);
  remove(context_.directory, take, name, observer_);
  shown_takes_.erase(take);
  coloring_.take_is_called(take, name);
  say("take " + take + " is called " + name + " now");
}

void Studio::delete_take(const std::string& take) {
  if (take == coloring_.base_name()) throw UsageError("what is shown now was begun from take " + take);
  remove(context_.directory, take, "", observer_);
  shown_takes_.erase(take);
  coloring_.take_is_called(take, "");
  say("take " + take + " is gone");
}

StrokeList Studio::saved_strokes() const {
  const std::lock_guard lock(mutex_);
  return strokes_;
}

// ---- state --------------------------------------------------------------------------------------------------------

void Studio::change(const std::function<void(StateMessage&)>& change) {
  const std::lock_guard lock(mutex_);
  change(state_);
  ++state_.version;
  news_.notify_all();
}

void Studio::say(const std::string& text, bool failed) {
  change([&](StateMessage& state) {
    state.message = text;
    state.failed = failed;
  });
}

void Studio::colors_changed() {
  change([](StateMessage& state) { ++state.colors; });
}

std::optional<std::pair<std::uint64_t, std::string>> Studio::wait_for_news(std::uint64_t after, double seconds) {
  std::unique_lock lock(mutex_);
  const auto has_news = [&] { return state_.version != after || is_closed_; };
  if (!news_.wait_for(lock, std::chrono::duration<double>(seconds), has_news) || state_.version == after) {
    return std::nullopt;
  }
  return std::pair{state_.version, json_of(state_).dump()};
}

void Studio::joined(const std::string& client) {
  const std::lock_guard lock(mutex_);
  ++followers_[client];
}

void Studio::left(const std::string& client) {
  const std::lock_guard lock(mutex_);
  if (--followers_[client] > 0) return;
  followers_.erase(client);
  if (state_.writer != client) return;
  state_.writer.clear();
  ++state_.version;
  news_.notify_all();
}

void Studio::close() {
  {
    const std::lock_guard lock(mutex_);
    is_closed_ = true;
    news_.notify_all();
    work_.notify_all();
  }
  frames_.close();
}

bool Studio::closed() const {
  const std::lock_guard lock(mutex_);
  return is_closed_;
}

}  // namespace cnerf::studio
