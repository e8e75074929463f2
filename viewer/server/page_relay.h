#pragma once
/// One API after another behind the same addresses: a program's stages. Streams of news go on from one to the next.

#include <map>
#include <memory>
#include <mutex>

#include "viewer/server/page_api.h"

namespace cnerf::web {

class PageRelay final : public PageApi {
 public:
  explicit PageRelay(std::string prefix) : prefix_(std::move(prefix)) {}

  /// From now on `api` answers; who followed the one before it follows this one. The one before is closed, and lives
  /// until it has given the answers that were begun.
  /// @param api  of the same prefix; its versions of news are later than those before
  void enter(std::shared_ptr<PageApi> api);

  [[nodiscard]] std::string prefix() const override { return prefix_; }
  [[nodiscard]] std::optional<std::size_t> largest_body(const std::string& method,
                                                        const std::string& path) const override;
  /// 503 before the first one.
  [[nodiscard]] PageAnswer answer(const PageRequest& request) override;
  [[nodiscard]] std::optional<std::pair<std::uint64_t, std::string>> wait_for_news(std::uint64_t after,
                                                                                   double seconds) override;
  void joined(const std::string& client) override;
  void left(const std::string& client) override;
  void close() override;
  [[nodiscard]] bool closed() const override;

 private:
  [[nodiscard]] std::shared_ptr<PageApi> current() const;

  std::string prefix_;
  mutable std::mutex mutex_;
  std::shared_ptr<PageApi> api_;
  std::map<std::string, int> followers_;  // streams of each client
  bool is_closed_ = false;
};

}  // namespace cnerf::web
