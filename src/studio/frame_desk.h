#pragma once
/// Frames that pages ask for and one thread draws. A page that asks again before its frame is drawn wants the newer one
/// alone.

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

namespace cnerf::studio {

class FrameDesk {
 public:
  /// Draws; is asked whether to go on by what it is handed.  @return  nothing where it was told to stop
  using Drawing = std::function<std::optional<std::string>(const std::function<bool()>& keep_going)>;

  /// @param changed  is called when there is something to draw
  explicit FrameDesk(std::function<void()> changed) : changed_(std::move(changed)) {}

  enum class Which {
    kUrgent,  ///< somebody moves the camera
    kAll,
  };

  /// Waits for the frame.  @return  nothing where the client wants another by now, or the desk is closed
  /// @throws  what the drawing throws
  [[nodiscard]] std::optional<std::string> ask(const std::string& client, bool is_urgent, Drawing drawing);

  /// Draws what waits, on the calling thread.  @return  whether there was anything
  bool draw_waiting(Which which = Which::kAll);
  [[nodiscard]] bool has_waiting(Which which = Which::kAll) const;
  /// Lets everybody go.
  void close();

 private:
  struct Frame {
    std::string client;
    Drawing drawing;
    bool is_urgent = false, is_stale = false, is_done = false;
    std::optional<std::string> result;
    std::exception_ptr failure;
  };

  using Waiting = std::list<std::shared_ptr<Frame>>;
  [[nodiscard]] Waiting::const_iterator next(Which which) const;

  std::function<void()> changed_;
  mutable std::mutex mutex_;
  std::condition_variable done_;
  Waiting waiting_;
  std::shared_ptr<Frame> drawn_now_;
  bool is_closed_ = false;
};

}  // namespace cnerf::studio
