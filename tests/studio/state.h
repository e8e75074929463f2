#pragma once
/// What the studio's state says.

#include <nlohmann/json.hpp>
#include <string>

namespace cnerf::test {

/// Whether nothing is being done.
inline bool is_idle(const nlohmann::json& state) {
  return state.at("task").get<std::string>().empty();
}

}  // namespace cnerf::test
