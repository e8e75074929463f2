#include "src/capture/stated_values.h"

#include <fmt/format.h>

#include <cmath>
#include <optional>

#include "src/base/error.h"
#include "src/base/json.h"
#include "src/base/text.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

constexpr std::string_view kBlanks = " \t\r\n";

/// Quoted, and shortened where it is long.
std::string quoted(std::string_view text) {
  return excerpt(nlohmann::json(text));
}

}  // namespace

std::vector<double> numbers_of(std::string_view text, std::size_t count, const fs::path& file,
                               const std::string& field) {
  const std::string expected = count == 1 ? "expected a number, found " : fmt::format("expected {} numbers, ", count);
  std::vector<double> numbers;
  for (std::size_t at = text.find_first_not_of(kBlanks); at < text.size(); at = text.find_first_not_of(kBlanks, at)) {
    const std::string_view word = text.substr(at, text.find_first_of(kBlanks, at) - at);
    const std::optional<double> value = value_in<double>(word);
    if (!value || !std::isfinite(*value)) {
      throw InputError(file, field, expected + (count == 1 ? "" : "found ") + quoted(word));
    }
    numbers.push_back(*value);
    at += word.size();
  }
  if (numbers.size() != count) {
    throw InputError(file, field, expected + (count == 1 ? quoted(text) : fmt::format("found {}", numbers.size())));
  }
  return numbers;
}

double number_of(std::string_view text, const fs::path& file, const std::string& field) {
  return numbers_of(text, 1, file, field).front();
}

int side_of_image(double value, const fs::path& file, const std::string& field) {
  if (value >= 1 && value <= 1e5 && value == std::floor(value)) return int(value);
  throw InputError(file, field, fmt::format("expected a size in pixels, found {:g}", value));
}

double above_zero(double value, const fs::path& file, const std::string& field) {
  if (value > 0) return value;
  throw InputError(file, field, fmt::format("expected a number above 0, found {:g}", value));
}

Mat3d matrix_of(const std::vector<double>& rows) {
  Mat3d out;
  for (std::size_t i = 0; i < 9; ++i) out.rows[i / 3][int(i % 3)] = rows[i];
  return out;
}

}  // namespace cnerf
