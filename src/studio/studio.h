#pragma once
/// The studio: a run that is trained, looked at, painted and coloured through a page. One thread works (the one that
/// calls `run`): it draws frames and carries out orders, a training step at a time; the server's threads ask.

#include <atomic>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "src/base/observer.h"
#include "src/base/usage.h"
#include "src/pipeline/run_context.h"
#include "src/studio/board_api.h"
#include "src/studio/board_observer.h"
#include "src/studio/coloring.h"
#include "src/studio/frame_desk.h"
#include "src/studio/refresh_pace.h"

namespace cnerf::studio {

/// GET  scene, state, events, photos/I, thumbnails/I, strokes, reach/I, cards/I, files/I
/// PUT  strokes
/// POST frame, reach, orders, pictures
/// As src/studio/messages.h and src/train/chroma/strokes.h have the bodies. I numbers the capture's views, and after
/// them the viewpoints of the strokes that are saved. Whoever orders or paints first is the writer until its stream of
/// events ends; others follow.
class Studio final : public BoardApi<Studio> {
 public:
  /// Loads what there is of the run, and what was painted before. Holds its folder `strokes`, and the whole of it until
  /// stage 1 is trained. All are referred to.
  /// @param context  of a run that was begun; its capture gets what training learns of views
  /// @param take     to begin with, empty = grey; none: what the last studio ended with, else the current one
  /// @throws BusyError  another studio works on this run; SnapshotError, InputError of a stroke file
  Studio(pipeline::RunContext& context, std::optional<std::string> take, const Engines& engines, Observer& observer,
         const RetouchOptions& retouch = {});
  ~Studio() override;

  /// Trains what is not trained, draws and works until the user ends the program, or it is closed.
  void run();

  void close() override;

 private:
  /// What a page orders, and the picture that it sent for it.
  struct Order {
    OrderMessage message;
    std::filesystem::path picture;
  };
  struct OrderKind;
  static std::span<const OrderKind> order_kinds();
  static bool is_order_of_pages(const std::string& name);
  friend class BoardApi<Studio>;  // asks for the routes
  static std::span<const Route<Studio>> routes();

  // Answers, on the server's threads.
  web::PageAnswer get_scene(const web::PageRequest& request);
  web::PageAnswer get_state(const web::PageRequest& request);
  web::PageAnswer get_photo(const web::PageRequest& request);
  web::PageAnswer get_thumbnail(const web::PageRequest& request);
  web::PageAnswer get_strokes(const web::PageRequest& request);
  web::PageAnswer put_strokes(const web::PageRequest& request);
  web::PageAnswer get_reach(const web::PageRequest& request);
  web::PageAnswer post_reach(const web::PageRequest& request);
  web::PageAnswer post_frame(const web::PageRequest& request);
  web::PageAnswer post_order(const web::PageRequest& request);
  web::PageAnswer post_picture(const web::PageRequest& request);
  web::PageAnswer add_painted(const web::PageRequest& request, std::optional<int> view, const std::string& name,
                              const std::string& shown);
  web::PageAnswer get_painted(const web::PageRequest& request);
  web::PageAnswer get_card(const web::PageRequest& request);
  web::PageAnswer get_file(const web::PageRequest& request);
  web::PageAnswer reach_of(int view, const StrokeList& list, bool is_saved);
  /// What can be painted on, by its number: a view of the capture, else a viewpoint.
  struct Paintable {
    const View* view = nullptr;
    Viewpoint viewpoint;

    [[nodiscard]] const std::string& name() const { return view != nullptr ? view->name : viewpoint.name; }
    [[nodiscard]] Intrinsics lens() const { return view != nullptr ? view->intrinsics : viewpoint.camera.intrinsics(); }
    [[nodiscard]] bool is_held_out() const { return view != nullptr && view->held_out; }
  };
  /// @throws MissingInputError
  [[nodiscard]] Paintable numbered(int number, const StrokeList& list) const;
  [[nodiscard]] Paintable numbered_in(const web::PageRequest& request) const;
  web::PageAnswer viewpoint_photo(const Viewpoint& viewpoint, int side);
  web::PageAnswer viewpoint_thumbnail(const Viewpoint& viewpoint);
  /// Waits until the working thread has traced them.
  void see(const std::vector<Viewpoint>& viewpoints);
  /// What the working thread makes of it, whoever else asks for what; nothing where the studio is closed.
  std::optional<std::string> asked_alone(bool is_urgent, FrameDesk::Drawing drawing);
  web::PageAnswer change_at_once(const web::PageRequest& request, const OrderMessage& order);
  web::PageAnswer take_order(const web::PageRequest& request, const Order& order);
  /// Why no order of this client is taken now; nothing where one is.
  [[nodiscard]] std::optional<web::PageAnswer> refused_order(const std::string& client);
  void save(StrokeList list);
  [[nodiscard]] bool is_ready() const;

  // Work, on the thread of `run`.
  void work_on(const Order& order);
  void carry_out(const Order& order);
  void train(const Order& order);
  void watch_training(const LuminanceModel& model);
  void open_field();
  void cache_views(const Order& order);
  void color_again();
  void colour(const Order& order);
  void breathe_in_color(const char* task, double fraction);
  [[nodiscard]] std::vector<TakeMessage> readable_takes();
  void save_now();
  void set_now_aside(const std::string& why);
  void forget_now();
  void keep(const Order& order);
  void keep_as(const std::string& take);
  void begin(const Order& order);
  void begin_from(const std::string& take);
  void rename_take(const Order& order);
  void duplicate_take(const Order& order);
  void delete_take(const Order& order);
  void suggest(const Order& order);
  void suggest_views(const Order& order);
  void color_by_reference(const Order& order);
  void color_by_network(const Order& order);
  void bake(const Order& order);
  void write_photographs(const Order& order);
  /// A take as a colorizer makes it, shown while it learns, then begun from.
  std::string colorize(const ColorizerOptions& colorizer, const std::vector<int>& bases);
  void watch_colors(const ColorModel& model);
  class ConfigInstead;
  /// The take that "now" is, kept where it was in none yet.
  std::string take_of_now();
  /// Between two pieces of work: pages want frames, and users may have had enough.
  void breathe(const std::string& task, double fraction);
  void draw_frames();
  void begin_pace();
  [[nodiscard]] BoardObserver observer_of(const std::string& task);
  [[nodiscard]] FieldCamera affordable(FieldCamera camera) const;
  /// A JPEG of each side; none where it was told to stop.
  std::vector<std::string> drawn(const FrameMessage& message, const std::function<bool()>& keep_going);
  /// Viewpoints that are not in the list any more are no longer kept as they were traced.
  void forget_viewpoints();
  [[nodiscard]] const ColorModel* side_named(const std::string& name);
  void offer_downloads(const std::vector<std::filesystem::path>& files);
  void colors_changed();

  [[nodiscard]] StrokeList saved_strokes() const;
  [[nodiscard]] Finish finish() const;
  [[nodiscard]] bool should_stop() const;
  /// "cnerf COMMAND RUN WORDS": what repeats a thing that was done, in a terminal.
  void add_command(const std::string& command, std::vector<std::string> words,
                   const std::vector<std::string>& more = {});
  void add_line(const std::vector<std::string>& words);
  void add_lines_of_training();

  pipeline::RunContext& context_;
  PaintedPictures painted_;
  const Engines& engines_;
  Observer& observer_;
  RetouchOptions retouch_;
  std::optional<FolderLock> run_lock_;
  FolderLock lock_;
  bool goes_on_;           // with what no take held when the last studio ended
  bool owns_now_ = false;  // the file of what no take holds is of the colours that are shown
  std::string first_take_;

  // Of the working thread; what server threads see of them does not change once the state is `ready`.
  std::optional<Coloring> coloring_;      // once stage 1 is trained
  std::optional<LuminanceModel> halted_;  // of a training that was stopped
  const LuminanceModel* field_ = nullptr;
  const ColorModel* learning_ = nullptr;                            // of a take that a colorizer makes
  std::map<std::string, std::unique_ptr<ColorModel>> shown_takes_;  // that sides name
  std::set<std::string> left_out_;                                  // takes that cannot be read, as the user was told
  int forgotten_at_ = 0;                                            // revision of the strokes
  Stopwatch since_drawn_, since_refresh_, since_begun_;
  RefreshPace pace_;            // of the colouring that began then
  double affordable_rays_ = 0;  // of a frame while it trains
  double drawing_seconds_ = 0;  // that the last frame of a training took

  mutable std::mutex mutex_;  // of what follows; taken before the board's
  std::condition_variable work_;
  std::string scene_;
  StrokeList strokes_;
  struct Photo {
    Viewpoint of;
    std::string jpeg;
  };
  std::vector<Photo> photos_;                     // of viewpoints that are saved
  std::vector<std::filesystem::path> downloads_;  // as the state has them
  std::vector<std::string> cards_;                // JPEG
  std::optional<Order> order_;                    // that waits
  bool is_working_ = true;                        // `run` begins with work of its own
  bool stop_requested_ = false;
  FrameDesk frames_;
  std::atomic<std::uint64_t> asked_alone_ = 0;
};

}  // namespace cnerf::studio
