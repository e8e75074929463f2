#include "viewer/server/page_relay.h"

#include <utility>

namespace cnerf::web {

void PageRelay::enter(std::shared_ptr<PageApi> api) {
  std::shared_ptr<PageApi> before;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [client, streams] : followers_) {
      for (int i = 0; i < streams; ++i) api->joined(client);
    }
    before = std::exchange(api_, std::move(api));
    if (is_closed_) api_->close();
  }
  if (before) before->close();
}

std::shared_ptr<PageApi> PageRelay::current() const {
  const std::lock_guard lock(mutex_);
  return api_;
}

std::optional<std::size_t> PageRelay::largest_body(const std::string& method, const std::string& path) const {
  const auto api = current();
  return api ? api->largest_body(method, path) : std::nullopt;
}

PageAnswer PageRelay::answer(const PageRequest& request) {
  const auto api = current();
  return api ? api->answer(request) : refusal(503, "in a moment");
}

std::optional<std::pair<std::uint64_t, std::string>> PageRelay::wait_for_news(std::uint64_t after, double seconds) {
  const auto api = current();
  return api ? api->wait_for_news(after, seconds) : std::nullopt;
}

void PageRelay::joined(const std::string& client) {
  const std::lock_guard lock(mutex_);
  ++followers_[client];
  if (api_) api_->joined(client);
}

void PageRelay::left(const std::string& client) {
  const std::lock_guard lock(mutex_);
  if (--followers_[client] <= 0) followers_.erase(client);
  if (api_) api_->left(client);
}

void PageRelay::close() {
  const std::lock_guard lock(mutex_);
  is_closed_ = true;
  if (api_) api_->close();
}

bool PageRelay::closed() const {
  const std::lock_guard lock(mutex_);
  return is_closed_;
}

}  // namespace cnerf::web
