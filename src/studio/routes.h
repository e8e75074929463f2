#pragma once
/// Addresses of a page's API, each with what answers there.

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "src/base/text.h"
#include "viewer/server/page_api.h"

namespace cnerf::studio {

inline constexpr std::size_t kSmallBody = 65536;  ///< bytes of a request that is no file

/// A whole number from 0 on; nothing where the text is none.
[[nodiscard]] inline std::optional<int> number_in(std::string_view text) {
  const std::optional<int> value = value_in<int>(text);
  return value && *value >= 0 ? value : std::nullopt;
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

}  // namespace cnerf::studio
