#include "src/base/text.h"

#include <gtest/gtest.h>

namespace cnerf {
namespace {

TEST(Text, DurationsAreReadable) {
  EXPECT_EQ(duration_text(12.4), "12 s");
  EXPECT_EQ(duration_text(200), "3 min 20 s");
  EXPECT_EQ(duration_text(3725), "1 h 02 min");
}

TEST(Text, WordsAreJoined) {
  EXPECT_EQ(joined({}), "");
  EXPECT_EQ(joined({"a", "b"}), "a b");
  EXPECT_EQ(joined({"a", "b", "c"}, ", "), "a, b, c");
}

}  // namespace
}  // namespace cnerf
