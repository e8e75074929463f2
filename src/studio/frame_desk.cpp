#include "src/studio/frame_desk.h"

#include <algorithm>
#include <utility>

namespace cnerf::studio {

std::optional<std::string> FrameDesk::ask(const std::string& client, bool is_urgent, Drawing drawing) {
  auto frame = std::make_shared<Frame>();
  frame->is_urgent = is_urgent;
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

FrameDesk::Waiting::const_iterator FrameDesk::next(Which which) const {
  return std::ranges::find_if(
      waiting_, [&](const std::shared_ptr<Frame>& frame) { return which == Which::kAll || frame->is_urgent; });
}

bool FrameDesk::draw_waiting(Which which) {
  bool has_drawn = false;
  for (;;) {
    std::shared_ptr<Frame> frame;
    {
      const std::lock_guard lock(mutex_);
      const auto first = next(which);
      if (first == waiting_.end() || is_closed_) return has_drawn;
      frame = drawn_now_ = *first;
      waiting_.erase(first);
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

bool FrameDesk::has_waiting(Which which) const {
  const std::lock_guard lock(mutex_);
  return next(which) != waiting_.end();
}

void FrameDesk::close() {
  const std::lock_guard lock(mutex_);
  is_closed_ = true;
  done_.notify_all();
}

}  // namespace cnerf::studio
