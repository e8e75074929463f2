#pragma once
/// The studio: a run that is looked at, painted and coloured through a page. One thread works (the one that calls
/// `run`): it draws frames and carries out orders, a training step at a time; the server's threads ask.

#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "src/base/observer.h"
#include "src/pipeline/run_context.h"
#include "src/studio/coloring.h"
#include "src/studio/frame_desk.h"
#include "src/studio/messages.h"
#include "viewer/server/page_api.h"

namespace cnerf::studio {

/// GET  scene, state, events, photos/I, thumbnails/I, strokes, reach/I, files/I
/// PUT  strokes
/// POST frame, reach, orders, pictures
/// As src/studio/messages.h and src/train/chroma/strokes.h have the bodies. Whoever orders or paints first is the
/// writer until its stream of events ends; others follow.
class Studio final : public web::PageApi {
 public:
  /// Loads the run and what was painted before. Holds its folder `strokes`. All are referred to.
  /// @param take  to begin with; empty = grey
  /// @throws BusyError  another studio works on this run; SnapshotError, InputError of a stroke file
  Studio(const pipeline::RunContext& context, const std::string& take, const Engines& engines, Observer& observer,
         const RetouchOptions& retouch = {});
  ~Studio() override;

  /// Draws and works until the user ends the program, or it is closed.
  void run();

  [[nodiscard]] std::string prefix() const override { return "/studio"; }
  [[nodiscard]] std::optional<std::size_t> largest_body(const std::string& method,
                                                        const std::string& path) const override;
  [[nodiscard]] web::PageAnswer answer(const web::PageRequest& request) override;
  [[nodiscard]] std::optional<std::pair<std::uint64_t, std::string>> wait_for_news(std::uint64_t after,
                                                                                   double seconds) override;
  void joined(const std::string& client) override;
  void left(const std::string& client) override;
  void close() override;
  [[nodiscard]] bool closed() const override;

 private:
  /// What a page orders, and the picture that it sent for it.
  struct Order {
    OrderMessage message;
    std::filesystem::path picture;
  };
  using Handler = web::PageAnswer (Studio::*)(const web::PageRequest&);
  struct Route;
  static const std::vector<Route>& routes();

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
  web::PageAnswer reach_of(std::size_t view, const std::vector<Stroke>& strokes);
  [[nodiscard]] std::size_t view_in(const web::PageRequest& request) const;
  web::PageAnswer take_order(const web::PageRequest& request, const Order& order);
  void become_writer(const std::string& client);

  web::PageAnswer post_picture(const web::PageRequest& request);
  web::PageAnswer get_file(const web::PageRequest& request);

  // Work, on the thread of `run`.
  void work_on(const Order& order);
  void carry_out(const Order& of_page);
  void colour();
  void color_by_reference(const std::filesystem::path& picture);
  void bake(const std::vector<std::string>& formats);
  void write_photographs(const std::string& format);
  /// The take that "now" is, kept where it was in none yet.
  std::string take_of_now();
  void breathe(const std::string& task, double fraction);
  void rename_take(const std::string& take, const std::string& name);
  void duplicate_take(const std::string& take, const std::string& name);
  void delete_take(const std::string& take);
  static void check_new_name(const std::string& name);
  [[nodiscard]] StrokeList saved_strokes() const;
  std::string drawn(const FrameMessage& message, const std::function<bool()>& keep_going);
  [[nodiscard]] const ColorModel* side_named(const std::string& name);

  class JobObserver;
  void offer_downloads(const std::vector<std::filesystem::path>& files);
  void change(const std::function<void(StateMessage&)>& change);
  void say(const std::string& text, bool failed = false);
  void colors_changed();
  [[nodiscard]] std::vector<TakeMessage> list_takes() const;
  [[nodiscard]] bool should_stop() const;

  const pipeline::RunContext& context_;
  const Engines& engines_;
  Observer& observer_;
  RetouchOptions retouch_;
  FolderLock run_lock_, lock_;
  std::string scene_;
  Coloring coloring_;
  std::map<std::string, std::unique_ptr<ColorModel>> shown_takes_;  // that sides name; of the working thread

  mutable std::mutex mutex_;
  std::condition_variable work_, news_;
  StateMessage state_;
  StrokeList strokes_;
  std::vector<std::filesystem::path> downloads_;  // as state_.downloads has them
  std::map<std::string, int> followers_;          // streams of each client
  std::optional<Order> order_;                    // that waits
  bool is_working_ = true /* `run` begins with tracing the views */, stop_requested_ = false, is_closed_ = false;
  FrameDesk frames_;
};

}  // namespace cnerf::studio
