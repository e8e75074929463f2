#include "src/studio/frame_desk.h"

#include <algorithm>
#include <utility>

namespace cnerf::studio {

std::optional<std::string> FrameDesk::ask(const std::string& client, Drawing drawing) {
  auto frame = std::make_shared<Frame>();
  frame->client = client;
  frame->drawing = std::move(drawing);
  {
    const std::lock_guard lock(mutex_);
    if (is_closed_) return std::nullopt;
    const auto drop = [&](const std::shared_ptr<Frame>& older) {
      if (older->client != client) return false;
      older->is_stale = older->is_done = true;
      return true;
    };
    std::erase_if(waiting_, drop);
    if (drawn_now_ && drawn_now_->client == client) drawn_now_->is_stale = true;
    waiting_.push_back(frame);
    done_.notify_all();
  }
  changed_();
  std::unique_lock lock(mutex_);
  done_.wait(lock, [&] { return frame->is_done || is_closed_; });
  if (frame->failure) std::rethrow_exception(frame->failure);
  return std::move(frame->result);
}

bool FrameDesk::draw_waiting() {
  bool has_drawn = false;
  for (;;) {
    std::shared_ptr<Frame> frame;
    {
      const std::lock_guard lock(mutex_);
      if (waiting_.empty() || is_closed_) return has_drawn;
      frame = drawn_now_ = waiting_.front();
      waiting_.pop_front();
    }
    std::optional<std::string> result;
    std::exception_ptr failure;
    try {
      result = frame->drawing([&] {
        const std::lock_guard lock(mutex_);
        return !frame->is_stale && !is_closed_;
      });
    } catch (...) {
      failure = std::current_exception();
    }
    const std::lock_guard lock(mutex_);
    drawn_now_.reset();
    frame->result = std::move(result);
    frame->failure = failure;
    frame->is_done = true;
    done_.notify_all();
    has_drawn = true;
  }
}

bool FrameDesk::has_waiting() const {
  const std::lock_guard lock(mutex_);
  return !waiting_.empty();
}

void FrameDesk::close() {
  const std::lock_guard lock(mutex_);
  is_closed_ = true;
  done_.notify_all();
}

}  // namespace cnerf::studio
