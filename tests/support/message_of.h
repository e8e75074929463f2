#pragma once
/// What an exception says.

#include <gtest/gtest.h>

#include <exception>
#include <string>

namespace cnerf::test {

/// Runs `body`, which must throw `E`, and returns the message.
template <typename E, typename Body>
std::string message_of(Body&& body) {
  try {
    body();
  } catch (const E& error) {
    return error.what();
  } catch (const std::exception& error) {
    ADD_FAILURE() << "threw another type: " << error.what();
    return "";
  }
  ADD_FAILURE() << "threw nothing";
  return "";
}

}  // namespace cnerf::test
