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

TEST(Text, Utf8AsTheStandardHasIt) {  // Unicode 15, table 3-7
  for (const char* good :
       {"", "grey", "gr\xC3\xBCn", "\xE2\x82\xAC", "\xF0\x9F\x8E\xA8", "\xED\x9F\xBF", "\xF4\x8F\xBF\xBF"}) {
    EXPECT_TRUE(is_utf8(good)) << good;
  }
  for (const char* bad : {"\xFF", "\x80", "gr\xFCn", "\xC3", "\xC0\xAF", "\xE0\x80\xAF", "\xED\xA0\x80",
                          "\xF4\x90\x80\x80", "\xE2\x82", "\xF5\x80\x80\x80"}) {
    EXPECT_FALSE(is_utf8(bad)) << bad;
  }
  EXPECT_TRUE(is_utf8(std::string_view("a\0b", 3)));
}

TEST(Text, NothingPrintableMovesTheCursor) {
  EXPECT_EQ(printable("a\x1b[2Jb\x7f\b\ttab\n"), "a?[2Jb??\ttab\n");
  EXPECT_EQ(printable("10 %\r20 %"), "10 %\n20 %");
  EXPECT_EQ(printable("gr\xC3\xBCn"), "gr\xC3\xBCn");
}

TEST(Text, WhatIsTooLongEndsBetweenCharacters) {
  EXPECT_EQ(shortened("gr\xC3\xBCn", 5), "gr\xC3\xBCn");
  EXPECT_EQ(shortened("gr\xC3\xBCn", 4), "gr\xC3\xBC…");
  EXPECT_EQ(shortened("gr\xC3\xBCn", 3), "gr…");
  EXPECT_EQ(shortened("abc", 0), "…");
}

}  // namespace
}  // namespace cnerf
