#include "src/base/json.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "tests/support/data.h"

namespace cnerf::test {
namespace {
using testing::AllOf;
using testing::HasSubstr;
using testing::Lt;
using testing::ResultOf;
using testing::ThrowsMessage;

std::string nested(int depth) {
  return std::string(std::size_t(depth), '[') + std::string(std::size_t(depth), ']');
}

TEST(Json, NestsSixtyFourDeep) {
  EXPECT_EQ(parse_json(nested(kDeepestJson + 1), "a.json").dump(), nested(kDeepestJson + 1));
  EXPECT_THAT([] { (void)parse_json(nested(kDeepestJson + 2), "a.json"); },
              ThrowsMessage<InputError>(AllOf(HasSubstr("a.json"), HasSubstr("at most 64 levels"))));
}

TEST(Json, DepthOfAMegabyteIsRefused) {
  EXPECT_THROW((void)parse_json(nested(500'000), "a.json"), InputError);
  std::string objects;
  for (int i = 0; i < 100'000; ++i) objects += "{\"a\":";
  EXPECT_THROW((void)parse_json(objects + "1" + std::string(100'000, '}'), "a.json"), InputError);
}

TEST(Json, OtherTextIsRefusedNamingTheFile) {
  EXPECT_THAT([] { (void)parse_json<SnapshotError>("{\"a\": nul}", "a.json"); },
              ThrowsMessage<SnapshotError>(AllOf(HasSubstr("a.json: expected JSON"), HasSubstr("line 1"))));
}

TEST(Json, ARefusalIsShortWhateverWasRead) {
  const std::string long_token = "{\"a\": /*" + std::string(100'000, '\1');
  EXPECT_THAT([&] { (void)parse_json(long_token, "a.json"); },
              ThrowsMessage<InputError>(ResultOf([](const std::string& text) { return text.size(); }, Lt(500u))));
}

TEST(Json, CommentsAreAllowed) {
  EXPECT_EQ(parse_json("/* of a user */ {\"a\": 1}", "a.json").at("a"), 1);
}

TEST(Json, PipesAreRefused) {
  const TempDir folder;
  ASSERT_EQ(::mkfifo((folder / "a.json").c_str(), 0600), 0);
  EXPECT_THAT([&] { (void)read_json(folder / "a.json"); },
              ThrowsMessage<InputError>(HasSubstr("found a folder, pipe")));
}

TEST(Json, MessagesQuoteTheBeginning) {
  EXPECT_EQ(excerpt(nlohmann::json("short")), "\"short\"");
  const std::string quoted = excerpt(nlohmann::json(std::string(1'000'000, 'x')));
  EXPECT_LT(quoted.size(), 130u);
  EXPECT_THAT(quoted, testing::EndsWith("…"));
  EXPECT_THAT(excerpt(nlohmann::json("a" + std::string(100, 'x') + "ä\xff")), HasSubstr("ä")) << "whatever it holds";
}

}  // namespace
}  // namespace cnerf::test
