#pragma once
/// What the studio's state says.

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "tests/support/sanitizers.h"

namespace cnerf::test {

/// Whether nothing is being done.
inline bool is_idle(const nlohmann::json& state) {
  return state.at("task").get<std::string>().empty();
}

/// The first state for which `holds` that `desk`, a Studio or a Reception, tells. Throws where it tells nothing for
/// long.
template <typename Desk>
nlohmann::json wait_until(Desk& desk, const std::function<bool(const nlohmann::json&)>& holds) {
  constexpr int kPatience = kIsSanitized ? 600 : 60;  // seconds
  std::uint64_t seen = 0;
  for (;;) {
    const auto news = desk.wait_for_news(seen, kPatience);
    if (!news) throw std::runtime_error("no news for " + std::to_string(kPatience) + " s");
    seen = news->first;
    if (nlohmann::json state = nlohmann::json::parse(news->second); holds(state)) return state;
  }
}

}  // namespace cnerf::test
