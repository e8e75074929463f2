#pragma once
/// What answers a page by its routes, and tells it of a board's news.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "src/base/error.h"
#include "src/studio/board.h"
#include "src/studio/routes.h"
#include "viewer/server/page_api.h"

namespace cnerf::studio {

/// @tparam Api  what derives from this; `Api::routes()` are its addresses
template <typename Api>
class BoardApi : public web::PageApi {
 public:
  [[nodiscard]] std::string prefix() const override { return "/studio"; }
  [[nodiscard]] std::optional<std::size_t> largest_body(const std::string& method,
                                                        const std::string& path) const override {
    const Route<Api>* route = route_to(method, path);
    return route != nullptr ? std::optional(route->largest_body) : std::nullopt;
  }
  /// What the request's handler says; its errors as refusals.
  [[nodiscard]] web::PageAnswer answer(const web::PageRequest& request) override {
    const Route<Api>* route = route_to(request.method, request.path);
    if (route == nullptr) return web::refusal(404, "not here");
    try {
      return (static_cast<Api&>(*this).*route->handler)(request);
    } catch (const MissingInputError& problem) {
      return web::refusal(404, problem.what());
    } catch (const Error& problem) {
      return web::refusal(problem.exit_code() == ExitCode::kOutput ? 507 : 400, problem.what());
    }
  }
  [[nodiscard]] std::optional<std::pair<std::uint64_t, std::string>> wait_for_news(std::uint64_t after,
                                                                                   double seconds) override {
    return board_.wait_for_news(after, seconds);
  }
  void joined(const std::string& client) override { board_.joined(client); }
  void left(const std::string& client) override { board_.left(client); }
  [[nodiscard]] bool closed() const override { return board_.closed(); }

 protected:
  Board board_;

 private:
  [[nodiscard]] static const Route<Api>* route_to(const std::string& method, const std::string& path) {
    for (const Route<Api>& route : Api::routes()) {
      if (route.is_for(method, path)) return &route;
    }
    return nullptr;
  }
};

}  // namespace cnerf::studio
