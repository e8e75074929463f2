#include "src/base/byte_count.h"

#include <cmath>
#include <cstdio>

#include "src/base/error.h"

namespace cnerf {

std::size_t bytes_from(const std::string& option, const std::string& text) {
  double amount = 0;
  char unit = 0, rest = 0;
  const int read = std::sscanf(text.c_str(), " %lf %c %c", &amount, &unit, &rest);
  const std::string units = "kMG";
  const std::size_t at = units.find(unit);
  const bool is_amount = (read == 1 || (read == 2 && at != std::string::npos)) && amount > 0 && amount < 1e12;
  if (!is_amount) {
    throw UsageError(option + ": expected an amount of memory like 4G or 500M, got \"" + text + "\"");
  }
  return std::size_t(std::ldexp(amount, read == 2 ? 10 * (int(at) + 1) : 0));
}

std::string in_words(std::size_t bytes) {
  char text[32];
  const double mib = std::ldexp(double(bytes), -20);
  if (mib >= 1000) {
    std::snprintf(text, sizeof text, "%.2f GiB", mib / 1024);
  } else {
    std::snprintf(text, sizeof text, "%.0f MiB", mib);
  }
  return text;
}

}  // namespace cnerf
