#pragma once
/// Addresses of a page's API, each with what answers there.

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "src/base/error.h"
#include "viewer/server/page_api.h"

namespace cnerf::studio {

inline constexpr std::size_t kSmallBody = 65536;  ///< bytes of a request that is no file

/// A whole number; nothing where the text is none.
[[nodiscard]] inline std::optional<int> number_in(std::string_view text) {
  int value = 0;
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
  return failure == std::errc() && end == text.data() + text.size() && value >= 0 ? std::optional(value) : std::nullopt;
}

/// The same of files' sizes.
[[nodiscard]] inline std::optional<std::uint64_t> size_in(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
  return failure == std::errc() && end == text.data() + text.size() ? std::optional(value) : std::nullopt;
}

template <typename Api>
struct Route {
  std::string method, path;  ///< one that ends with / goes on with a number
  std::size_t largest_body;
  web::PageAnswer (Api::*handler)(const web::PageRequest&);

  [[nodiscard]] bool is_for(const std::string& wanted, const std::string& address) const {
    if (method != wanted) return false;
    return path.ends_with('/') ? address.starts_with(path) && number_in(address.substr(path.size())).has_value()
                               : address == path;
  }
};

/// As PageApi::largest_body.
template <typename Api>
[[nodiscard]] std::optional<std::size_t> largest_body_of(std::span<const Route<Api>> routes, const std::string& method,
                                                         const std::string& path) {
  for (const Route<Api>& route : routes) {
    if (route.is_for(method, path)) return route.largest_body;
  }
  return std::nullopt;
}

/// What the request's handler says; its errors as refusals.
template <typename Api>
[[nodiscard]] web::PageAnswer answer_of(std::span<const Route<Api>> routes, Api& api, const web::PageRequest& request) {
  const auto route =
      std::ranges::find_if(routes, [&](const Route<Api>& one) { return one.is_for(request.method, request.path); });
  if (route == routes.end()) return web::refusal(404, "not here");
  try {
    return (api.*route->handler)(request);
  } catch (const MissingInputError& problem) {
    return web::refusal(404, problem.what());
  } catch (const Error& problem) {
    return web::refusal(problem.exit_code() == ExitCode::kOutput ? 507 : 400, problem.what());
  }
}

}  // namespace cnerf::studio
