#pragma once
/// Checks of preconditions. A failed one throws ContractError with the expression and the values it compared.

#include <sstream>
#include <string>

#include "src/base/error.h"

namespace cnerf::detail {

[[noreturn]] inline void contract_failed(const char* file, int line, const char* expression,
                                         const std::string& detail) {
  std::ostringstream message;
  message << file << ':' << line << ": contract broken: " << expression;
  if (!detail.empty()) message << " (" << detail << ')';
  throw ContractError(message.str());
}

template <typename A, typename B>
std::string two_values(const A& a, const B& b) {
  std::ostringstream text;
  text << a << " against " << b;
  return text.str();
}

}  // namespace cnerf::detail

#define CNERF_CHECK(condition, message)                                                          \
  do {                                                                                           \
    if (!(condition)) ::cnerf::detail::contract_failed(__FILE__, __LINE__, #condition, message); \
  } while (false)

#define CNERF_CHECK_EQ(a, b)                                                                                     \
  do {                                                                                                           \
    if (!((a) == (b)))                                                                                           \
      ::cnerf::detail::contract_failed(__FILE__, __LINE__, #a " == " #b, ::cnerf::detail::two_values((a), (b))); \
  } while (false)
