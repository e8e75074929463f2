#include "src/compare/rating.h"

#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "tests/support/data.h"

namespace cnerf::test {
namespace {
using namespace compare;
using Json = nlohmann::json;

std::vector<RatedPicture> pictures() {
  std::vector<RatedPicture> all;
  for (const char* view : {"v1", "v2", "v3"}) {
    for (const char* method : {"colornerf", "colorize-then-fuse", "without-purification"}) {
      const auto number = std::hash<std::string>{}(std::string(view) + method);
      all.push_back({"flower", view, method, "data:image/jpeg;base64," + std::to_string(number)});
    }
  }
  return all;
}

class RatingSheetTest : public testing::Test {
 protected:
  void SetUp() override {
    sheet_ = make_rating_sheet(pictures(), 7);
    write_file(folder_ / "key.json", sheet_.key);
    key_ = Json::parse(sheet_.key);
  }

  /// Answers that give each method a grade of its own.
  [[nodiscard]] Json answers(int own, int fused, int unpurified) const {
    Json made = {{"sheet", key_["sheet"]}, {"answers", Json::array()}};
    for (const auto& [item, what] : key_["items"].items()) {
      const int grade = what["method"] == "colornerf"            ? own
                        : what["method"] == "colorize-then-fuse" ? fused
                                                                 : unpurified;
      made["answers"].push_back({{"item", item}, {"plausibility", grade}, {"vividness", 6 - grade}});
    }
    return made;
  }

  std::filesystem::path save(const std::string& name, const Json& json) const {
    write_file(folder_ / name, json.dump());
    return folder_ / name;
  }

  [[nodiscard]] std::vector<MethodRating> read(const std::vector<std::filesystem::path>& files) const {
    return read_ratings(folder_ / "key.json", files);
  }

  TempDir folder_;
  RatingSheet sheet_;
  Json key_;
};

TEST_F(RatingSheetTest, NamesNoMethodAndShufflesThem) {
  for (const char* name : {"colornerf", "fuse", "purification", "flower"}) {
    EXPECT_EQ(sheet_.html.find(name), std::string::npos) << name;
  }
  EXPECT_EQ(key_["items"].size(), 9u);
  EXPECT_NE(make_rating_sheet(pictures(), 8).key, sheet_.key);
  EXPECT_EQ(make_rating_sheet(pictures(), 7).html, sheet_.html);
}

TEST_F(RatingSheetTest, AnswersBecomeMeansOverRaters) {
  const auto ratings = read({save("a.json", answers(5, 2, 3)), save("b.json", answers(4, 2, 1))});
  ASSERT_EQ(ratings.size(), 3u);
  EXPECT_EQ(ratings[0].method, "colornerf");
  EXPECT_DOUBLE_EQ(ratings[0].plausibility.mean, 4.5);
  EXPECT_DOUBLE_EQ(ratings[0].vividness.mean, 1.5);
  EXPECT_EQ(ratings[0].plausibility.n, 2);
  EXPECT_NEAR(*ratings[0].plausibility.half_width, 12.706 * 0.5, 1e-9);  // s / sqrt(2) = 0.5
  EXPECT_NE(ratings_markdown(ratings).find("| colornerf | 4.50 ± 6.35 | 1.50 ± 6.35 |"), std::string::npos);
  EXPECT_EQ(Json::parse(ratings_json(ratings))["methods"][0]["raters"], 2);
}

TEST_F(RatingSheetTest, RefusesAnswersThatCannotBeMeant) {
  Json bad = answers(5, 2, 3);
  bad["sheet"] = "another";
  EXPECT_THROW((void)read({save("a.json", bad)}), InputError);
  bad = answers(5, 2, 3);
  bad["answers"][0]["plausibility"] = 6;
  EXPECT_THROW((void)read({save("a.json", bad)}), InputError);
  bad["answers"][0]["plausibility"] = 2.5;
  EXPECT_THROW((void)read({save("a.json", bad)}), InputError);
  bad["answers"][0].erase("plausibility");
  EXPECT_THROW((void)read({save("a.json", bad)}), InputError);
  bad = answers(5, 2, 3);
  bad["answers"][0]["item"] = "99";
  EXPECT_THROW((void)read({save("a.json", bad)}), InputError);
  bad["answers"].erase(0);
  EXPECT_THROW((void)read({save("a.json", bad)}), InputError);  // one is missing
  bad = answers(5, 2, 3);
  bad["answers"].push_back(bad["answers"][0]);
  EXPECT_THROW((void)read({save("a.json", bad)}), InputError);  // one is there twice
  write_file(folder_ / "a.json", std::string("[1, 2"));
  EXPECT_THROW((void)read({folder_ / "a.json"}), InputError);
  EXPECT_THROW((void)read({folder_ / "missing.json"}), MissingInputError);
}

}  // namespace
}  // namespace cnerf::test
