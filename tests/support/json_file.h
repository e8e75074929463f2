#pragma once
/// JSON that the program wrote.

#include <filesystem>
#include <nlohmann/json.hpp>

#include "src/base/files.h"

namespace cnerf::test {

inline nlohmann::json json_of(const std::filesystem::path& file) {
  return nlohmann::json::parse(read_text_file(file));
}

}  // namespace cnerf::test
