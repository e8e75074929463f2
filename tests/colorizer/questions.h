#pragma once
/// Questions and expectations shared by the colorizer tests.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "src/base/error.h"
#include "src/colorizer/colorizer.h"
#include "tests/support/message_of.h"

namespace cnerf::test {

/// A batch whose lightness is a different number everywhere, in 10..90.
inline LightnessBatch some_question(int batch = 2, int height = 6, int width = 5) {
  LightnessBatch question{batch, height, width, {}};
  const int count = batch * height * width;
  for (int i = 0; i < count; ++i) question.lightness.push_back(10 + 80 * float(i) / float(count));
  return question;
}

inline std::unique_ptr<Colorizer> colorizer_of(const std::string& spec, double timeout_seconds = 90) {
  ColorizerOptions options;
  options.spec = spec;
  options.timeout_seconds = timeout_seconds;
  return make_colorizer(options);
}

}  // namespace cnerf::test
