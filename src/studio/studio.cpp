/// The studio's life: training, frames, and one order after another.

#include "src/studio/studio.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "src/base/error.h"
#include "src/picture/encode.h"
#include "src/pipeline/train_step.h"
#include "src/studio/paint_files.h"

namespace cnerf::studio {
namespace fs = std::filesystem;
namespace {

constexpr auto kPoll = std::chrono::milliseconds(50);  // Ctrl-C only sets a flag
constexpr std::size_t kMostTakesInMemory = 3;
constexpr int kJpegQuality = 88;
// A page that moves may slow a training to half on a processor, by a tenth on a GPU; one that rests by 2 %.
constexpr double kTrainingPerTurn = 1, kTrainingPerTurnOfGpu = 9;
constexpr double kTrainingPerRefresh = 50, kLeastBetweenRefreshes = 1, kMostBetweenRefreshes = 60;  // seconds

}  // namespace

Studio::Studio(pipeline::RunContext& context, std::string take, const Engines& engines, Observer& observer,
               const RetouchOptions& retouch)
    : context_(context),
      painted_(stroke_folder(context)),
      engines_(engines),
      observer_(observer),
      retouch_(retouch),
      run_lock_(pipeline::lock_folder(
          context.directory.root(),
          context.directory.record().stage1.finished ? FolderLock::Mode::kShared : FolderLock::Mode::kAlone, observer)),
      lock_(pipeline::lock_folder(stroke_folder(context), FolderLock::Mode::kAlone, observer)),
      first_take_(std::move(take)),
      scene_(json_of(scene_of(context.capture, context.directory.root().string())).dump()),
      frames_([this] { work_.notify_all(); }) {
  const fs::path file = stroke_folder(context_) / kStrokeFile;
  if (fs::exists(file)) strokes_ = read_strokes(file, paintable_views(context_.capture));
  const bool is_trained = context_.directory.record().stage1.finished;
  if (is_trained) {
    coloring_.emplace(context_, engines_);
    coloring_->begin(first_take_);
    field_ = &coloring_->luminance();
  }
  std::vector<TakeMessage> takes = list_takes();
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
      stop_requested_ = false;
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

/// An order that cannot be carried out is told; the studio stays.
void Studio::work_on(const Order& order) {
  try {
    carry_out(order);
  } catch (const Interrupted&) {
    board_.say("stopped; what was done by then stays");
  } catch (const Error& problem) {
    board_.say(problem.what(), true);
  } catch (const std::bad_alloc&) {
    board_.say("the memory does not suffice for this", true);
  }
  std::vector<TakeMessage> takes = list_takes();
  const std::lock_guard lock(mutex_);
  is_working_ = false;
  board_.change([&](StateMessage& state) {
    state.task.clear();
    state.step.clear();
    state.fraction = 0;
    state.takes = std::move(takes);
    if (!coloring_) return;
    state.take = coloring_->base_name();
    state.unkept = coloring_->is_unkept();
  });
}

// ---- training -----------------------------------------------------------------------------------------------------

void Studio::train(const Order& order) {
  if (coloring_) throw UsageError("the scene is trained");
  halted_.reset();
  field_ = nullptr;
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
  cache_views(order);
}

/// Between two steps of a training: frames are drawn, but not for longer than it may be slowed.
void Studio::watch_training(const LuminanceModel& model) {
  const double since = since_drawn_.seconds();
  const double per_turn = engines_.device() == Device::kCuda ? kTrainingPerTurnOfGpu : kTrainingPerTurn;
  const double pause = std::min(kTrainingPerRefresh * drawing_seconds_, kMostBetweenRefreshes);
  const auto which = since >= pause ? FrameDesk::Which::kAll : FrameDesk::Which::kUrgent;
  if (since >= per_turn * drawing_seconds_ && frames_.has_waiting(which)) {
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
  std::string scene = json_of(scene_of(context_.capture, context_.directory.root().string())).dump();
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
  if (field_ != nullptr) frames_.draw_waiting();
}

const ColorModel* Studio::side_named(const std::string& name) {
  if (name == pipeline::kGreyTake || !coloring_) return nullptr;
  if (name == kNow) return learning_ != nullptr ? learning_ : coloring_->now();
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
  const std::vector<Picture> pictures = draw_field(
      *field_, camera_of(message), sides, sharp_effort(context_.config.render.steps_per_box, finish()), keep_going);
  if (pictures.empty()) return {};
  Picture all = pictures.front();
  for (std::size_t s = 1; s < pictures.size(); ++s) {
    all.rgb.insert(all.rgb.end(), pictures[s].rgb.begin(), pictures[s].rgb.end());
    all.height += pictures[s].height;
  }
  const std::vector<std::byte> bytes = jpeg_bytes(all, kJpegQuality);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
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

void Studio::add_command(const std::string& command) {
  board_.change([&](StateMessage& state) { state.commands.push_back(command); });
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
