/// The studio's life: training, frames, and one order after another.

#include "src/studio/studio.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/parallel.h"
#include "src/picture/encode.h"
#include "src/pipeline/train_step.h"
#include "src/studio/paint_files.h"

namespace cnerf::studio {
namespace fs = std::filesystem;
namespace {

constexpr std::size_t kMostTakesInMemory = 4;
constexpr int kJpegQuality = 88;
/// Seconds of training per second of drawing, so that a page that moves slows it by less than half on a processor and a
/// tenth on a GPU, and one that rests by less than 2 %. A GPU also loses the steps that it had begun.
struct Pace {
  double while_turning, while_resting;
};
constexpr Pace kPace = {1.3, 70}, kPaceOfGpu = {14, 120};
constexpr double kFrameOfTraining = 0.25;  // seconds, at most: what is half learned is fog, and dear
constexpr double kFirstRays = 600, kMostGrowth = 4;
constexpr double kLeastBetweenRefreshes = 1, kMostBetweenRefreshes = 60;  // seconds

/// The take that a run shows; grey where it is gone, or its record cannot be read.
std::string current_take(const pipeline::RunDirectory& directory, Observer& observer) {
  try {
    return directory.choose_take("");
  } catch (const Error& problem) {
    observer.say(std::string("note: begun in grey: ") + problem.what());
    return "";
  }
}

}  // namespace

Studio::Studio(pipeline::RunContext& context, std::optional<std::string> take, const Engines& engines,
               Observer& observer, const RetouchOptions& retouch)
    : context_(context),
      painted_(stroke_folder(context)),
      engines_(engines),
      observer_(observer),
      retouch_(retouch),
      run_lock_(pipeline::lock_folder(
          context.directory.root(),
          context.directory.record().stage1.finished ? FolderLock::Mode::kShared : FolderLock::Mode::kAlone, observer)),
      lock_(pipeline::lock_folder(stroke_folder(context), FolderLock::Mode::kAlone, observer)),
      goes_on_(!take),
      first_take_(take ? std::move(*take) : current_take(context.directory, observer)),
      scene_(json_of(scene_of(context.capture, name_of_run(context.directory.root()))).dump()),
      frames_([this] { work_.notify_all(); }) {
  const fs::path file = stroke_folder(context_) / kStrokeFile;
  if (fs::exists(file)) strokes_ = read_strokes(file, paintable_views(context_.capture));
  const bool is_trained = context_.directory.record().stage1.finished;
  if (is_trained) {
    coloring_.emplace(context_, engines_);
    coloring_->begin(first_take_);
    field_ = &coloring_->luminance();
  }
  std::vector<TakeMessage> takes = readable_takes();
  board_.change([&](StateMessage& state) {
    state.stage = is_trained ? kField : kTraining;
    state.strokes = strokes_.revision;
    state.take = first_take_;
    state.takes = std::move(takes);
    state.finish = context_.config.finish;
  });
}

Studio::~Studio() {
  close();
}

void Studio::run() {
  Order first;
  first.message.order = coloring_ ? "cache" : "train";
  work_on(first);
  while (!interruption_requested() && !closed()) {
    draw_frames();
    std::optional<Order> order;
    {
      std::unique_lock lock(mutex_);
      work_.wait_for(lock, kPoll,
                     [&] { return order_ || (field_ != nullptr && frames_.has_waiting()) || board_.closed(); });
      std::swap(order, order_);
      is_working_ = order.has_value();
    }
    forget_viewpoints();
    if (order) work_on(*order);
  }
}

void Studio::forget_viewpoints() {
  std::vector<Viewpoint> kept;
  {
    const std::lock_guard lock(mutex_);
    if (!coloring_ || strokes_.revision == forgotten_at_) return;
    forgotten_at_ = strokes_.revision;
    kept = strokes_.viewpoints;
  }
  coloring_->forget_others(kept);
}

/// The takes whose records can be read; of each other one the user is told once.
std::vector<TakeMessage> Studio::readable_takes() {
  std::vector<TakeMessage> takes;
  for (const std::string& name : context_.directory.take_names()) {
    try {
      if (const auto record = context_.directory.take_record(name)) {
        takes.push_back({name, record->colorizer, record->stage2.seconds});
      }
    } catch (const Error& problem) {
      if (!left_out_.insert(name).second) continue;
      const std::string note = "note: take " + name + " is left out: " + problem.what();
      observer_.say(note);
      board_.note(note);
    }
  }
  return takes;
}

void Studio::work_on(const Order& order) {
  const auto setback = setback_of([&] { carry_out(order); }, "stopped; what was done by then stays");
  std::vector<TakeMessage> takes = readable_takes();
  const std::lock_guard lock(mutex_);
  is_working_ = false;
  board_.change([&](StateMessage& state) {
    end_task(state, setback);
    state.takes = std::move(takes);
    if (!coloring_) return;
    state.take = coloring_->base_name();
    state.unkept = coloring_->is_unkept();
    state.ready = coloring_->seen() != nullptr;
  });
}

// ---- training -----------------------------------------------------------------------------------------------------

void Studio::train(const Order& order) {
  if (coloring_) throw UsageError("the scene is trained");
  halted_.reset();
  field_ = nullptr;
  affordable_rays_ = kFirstRays;
  BoardObserver observer(
      board_, observer_, "train", [] {}, [this] { return should_stop(); });
  const auto watch = [this](const LuminanceModel& model) { watch_training(model); };
  try {
    pipeline::train_step(context_, {.resume = true, .watch = watch}, engines_, observer);
  } catch (const Error&) {
    // What was learned by then can be looked at.
    if (fs::exists(context_.directory.stage1_snapshot()) && !board_.closed()) {
      halted_ = LuminanceModel::load(context_.directory.stage1_snapshot(), engines_);
      field_ = &*halted_;
      colors_changed();
    }
    throw;
  }
  open_field();
  add_lines_of_training();
  cache_views(order);
}

/// Between two steps of a training: frames are drawn, but not for longer than it may be slowed.
void Studio::watch_training(const LuminanceModel& model) {
  const double since = since_drawn_.seconds();
  const Pace& pace = engines_.device() == Device::kCuda ? kPaceOfGpu : kPace;
  const double pause = std::min(pace.while_resting * drawing_seconds_, kMostBetweenRefreshes);
  const auto which = since >= pause ? FrameDesk::Which::kAll : FrameDesk::Which::kUrgent;
  if (since >= pace.while_turning * drawing_seconds_ && frames_.has_waiting(which)) {
    const Stopwatch drawing;
    field_ = &model;
    frames_.draw_waiting(which);
    field_ = nullptr;
    drawing_seconds_ = drawing.seconds();
    since_drawn_ = {};
  }
  if (since < pause || since_refresh_.seconds() < std::max(pause, kLeastBetweenRefreshes)) return;
  since_refresh_ = {};
  colors_changed();
}

/// What was trained is there to be coloured, its views as training found them to be.
void Studio::open_field() {
  run_lock_.reset();
  run_lock_.emplace(pipeline::lock_folder(context_.directory.root(), FolderLock::Mode::kShared, observer_));
  pipeline::use_learned_views(context_, observer_);
  coloring_.emplace(context_, engines_);
  field_ = &coloring_->luminance();
  std::string scene = json_of(scene_of(context_.capture, name_of_run(context_.directory.root()))).dump();
  const std::lock_guard lock(mutex_);
  scene_ = std::move(scene);
  board_.change([&](StateMessage& state) {
    state.stage = kField;
    ++state.scene;
    ++state.colors;
  });
}

// ---- pictures -----------------------------------------------------------------------------------------------------

void Studio::draw_frames() {
  if (field_ == nullptr) return;
  frames_.draw_waiting(FrameDesk::Which::kUrgent);
  const Stopwatch watch;  // of what refreshes made pages ask for
  frames_.draw_waiting();
  pace_.drew(watch.seconds());
}

const ColorModel* Studio::side_named(const std::string& name) {
  if (name.empty() || !coloring_) return nullptr;
  if (name == kNow) return learning_ != nullptr ? learning_ : coloring_->now();
  const auto found = shown_takes_.find(name);
  if (found != shown_takes_.end()) return found->second.get();
  pipeline::check_take_name(name);
  if (context_.directory.choose_take(name).empty()) return nullptr;  // "grey", where no take is called so
  auto model = std::make_unique<ColorModel>(ColorModel::load(context_.directory.take_snapshot(name), engines_));
  return (shown_takes_[name] = std::move(model)).get();
}

/// The same picture with no more pixels than a training can wait for. The page scales it.
FieldCamera Studio::affordable(FieldCamera camera) const {
  const double share = std::sqrt(affordable_rays_ / (double(camera.lens.width) * camera.lens.height));
  if (share >= 1) return camera;
  const auto side = [&](int full) { return std::max(1, int(full * share)); };
  camera.lens = resized(camera.lens, side(camera.lens.width), side(camera.lens.height));
  return camera;
}

std::vector<std::string> Studio::drawn(const FrameMessage& message, const std::function<bool()>& keep_going) {
  if (shown_takes_.size() + message.sides.size() > kMostTakesInMemory) {
    std::erase_if(shown_takes_, [&](const auto& take) {
      return std::ranges::find(message.sides, take.first) == message.sides.end();
    });
  }
  std::vector<Side> sides;
  for (const std::string& name : message.sides) sides.push_back(side_named(name));
  const bool is_training = !coloring_ && !halted_;
  const FieldCamera camera = is_training ? affordable(camera_of(message)) : camera_of(message);
  const Stopwatch watch;
  const std::vector<Picture> pictures =
      draw_field(*field_, camera, sides, sharp_effort(context_.config.render.steps_per_box, finish()), keep_going);
  if (pictures.empty()) return {};
  if (is_training) {
    const double rays = double(camera.lens.width) * camera.lens.height;
    affordable_rays_ = std::min(rays * kFrameOfTraining / watch.seconds(), kMostGrowth * rays);
  }
  std::vector<std::string> jpegs(pictures.size());
  parallel_tasks(jpegs.size(), [&](std::size_t s) { jpegs[s] = text_of(jpeg_bytes(pictures[s], kJpegQuality)); });
  return jpegs;
}

// ---- state --------------------------------------------------------------------------------------------------------

void Studio::breathe(const std::string& task, double fraction) {
  board_.change([&](StateMessage& state) {
    state.task = task;
    state.fraction = fraction;
  });
  draw_frames();
  if (should_stop()) throw Interrupted("stopped");
}

BoardObserver Studio::observer_of(const std::string& task) {
  const auto between = [this] {
    draw_frames();
    if (should_stop()) throw Interrupted("stopped");
  };
  return {board_, observer_, task, between, [this] { return should_stop(); }};
}

bool Studio::should_stop() const {
  const std::lock_guard lock(mutex_);
  return stop_requested_ || board_.closed() || interruption_requested();
}

StrokeList Studio::saved_strokes() const {
  const std::lock_guard lock(mutex_);
  return strokes_;
}

Finish Studio::finish() const {
  return board_.read([](const StateMessage& state) { return state.finish; });
}

void Studio::colors_changed() {
  board_.change([](StateMessage& state) { ++state.colors; });
}

bool Studio::is_ready() const {
  return board_.read([](const StateMessage& state) { return state.ready; });
}

void Studio::close() {
  {
    const std::lock_guard lock(mutex_);
    board_.close();
    work_.notify_all();
  }
  frames_.close();
}

}  // namespace cnerf::studio
