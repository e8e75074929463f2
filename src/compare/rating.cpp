#include "src/compare/rating.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <set>

#include "src/base/json_record.h"
#include "src/base/rng.h"
#include "src/compare/page.h"
#include "src/compare/results.h"

namespace cnerf::compare {
namespace {
namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// rating_key.json
struct Key {
  struct Item {
    std::string capture, view, method;

    template <typename Self, typename Visitor>
    static void visit(Self& self, Visitor&& v) {
      v("capture", self.capture);
      v("view", self.view);
      v("method", self.method);
    }
  };
  std::string sheet;  ///< digest of its pictures
  std::map<std::string, Item> items;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("sheet", self.sheet);
    v("items", self.items);
  }
};

/// What a rater saves.
struct Answers {
  struct Answer {
    std::string item;
    int plausibility = 0, vividness = 0;

    template <typename Self, typename Visitor>
    static void visit(Self& self, Visitor&& v) {
      v("item", self.item);
      v("plausibility", self.plausibility);
      v("vividness", self.vividness);
    }
  };
  std::string sheet;
  std::vector<Answer> answers;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("sheet", self.sheet);
    v("answers", self.answers);
  }
};

/// One rater's grades of a method.
struct Grades {
  double plausibility = 0, vividness = 0;  ///< sums
  int count = 0;
};

template <typename T>
void shuffle(std::vector<T>& values, SequentialRng& rng) {
  for (std::size_t i = values.size(); i > 1; --i) std::swap(values[i - 1], values[rng.below(std::uint32_t(i))]);
}

/// Pictures of one view of one capture in a group, both in random order.
std::vector<std::vector<RatedPicture>> shuffled_groups(std::vector<RatedPicture> pictures, std::uint64_t seed) {
  SequentialRng rng(seed, named_stream("rate"));
  std::vector<std::vector<RatedPicture>> groups;
  for (RatedPicture& picture : pictures) {
    auto group = std::ranges::find_if(groups, [&](const std::vector<RatedPicture>& each) {
      return each.front().capture == picture.capture && each.front().view == picture.view;
    });
    if (group == groups.end()) group = groups.insert(groups.end(), std::vector<RatedPicture>());
    group->push_back(std::move(picture));
  }
  shuffle(groups, rng);
  for (std::vector<RatedPicture>& group : groups) shuffle(group, rng);
  return groups;
}

std::map<std::string, Grades> grades_of_rater(const Key& key, const fs::path& file) {
  const auto read = read_record<Answers>(file);
  if (read.sheet != key.sheet) {
    throw InputError(file, "sheet", "these answers belong to another rating sheet than the key");
  }
  std::map<std::string, Grades> grades;
  std::set<std::string> seen;
  for (const Answers::Answer& answer : read.answers) {
    const auto refuse = [&](const std::string& problem) { throw InputError(file, "item " + answer.item, problem); };
    const auto item = key.items.find(answer.item);
    if (item == key.items.end()) refuse("the sheet has no such picture");
    if (!seen.insert(answer.item).second) refuse("is judged twice");
    for (const int grade : {answer.plausibility, answer.vividness}) {
      if (grade < 1 || grade > 5) refuse("expected whole numbers from 1 to 5, got " + std::to_string(grade));
    }
    Grades& of_method = grades[item->second.method];
    of_method.plausibility += answer.plausibility;
    of_method.vividness += answer.vividness;
    of_method.count += 1;
  }
  for (const auto& [item, what] : key.items) {
    if (!seen.contains(item)) throw InputError(file, "item " + item, "is not judged");
  }
  return grades;
}

}  // namespace

RatingSheet make_rating_sheet(std::vector<RatedPicture> pictures, std::uint64_t seed) {
  Key key;
  Json views = Json::array();
  for (const std::vector<RatedPicture>& group : shuffled_groups(std::move(pictures), seed)) {
    Json view = Json::array();
    for (const RatedPicture& picture : group) {
      const std::string item = std::to_string(key.items.size() + 1);
      key.items[item] = {picture.capture, picture.view, picture.method};
      view.push_back({{"item", item}, {"picture", picture.picture}});
    }
    views.push_back(std::move(view));
  }
  const std::string shown = views.dump();
  key.sheet = sha256(std::as_bytes(std::span(shown))).substr(0, 16);
  return {page_with(kRatingPage, {{"sheet", key.sheet}, {"views", views}}), json_of(key).dump(1) + "\n"};
}

std::vector<MethodRating> read_ratings(const fs::path& key_file, std::span<const fs::path> answers) {
  const Key key = read_record<Key>(key_file);
  std::map<std::string, std::array<std::vector<double>, 2>> means;  // of each rater
  for (const fs::path& file : answers) {
    for (const auto& [method, grades] : grades_of_rater(key, file)) {
      means[method][0].push_back(grades.plausibility / grades.count);
      means[method][1].push_back(grades.vividness / grades.count);
    }
  }
  std::vector<MethodRating> ratings;
  for (const auto& [method, scales] : means) ratings.push_back({method, *estimate(scales[0]), *estimate(scales[1])});
  std::ranges::stable_sort(ratings, std::ranges::greater(), [](const MethodRating& r) { return r.plausibility.mean; });
  return ratings;
}

std::string ratings_json(std::span<const MethodRating> ratings) {
  const auto scale = [](Estimate estimate) {
    Json json = json_of(estimate);
    json.erase("n");  // stands in "raters"
    return json;
  };
  Json json = {{"schema_version", 1}, {"methods", Json::array()}};
  for (const MethodRating& rating : ratings) {
    json["methods"].push_back({{"method", rating.method},
                               {"raters", rating.plausibility.n},
                               {"plausibility", scale(rating.plausibility)},
                               {"vividness", scale(rating.vividness)}});
  }
  return json.dump(2) + "\n";
}

std::string ratings_markdown(std::span<const MethodRating> ratings) {
  std::vector<std::vector<std::string>> lines;
  for (const MethodRating& rating : ratings) {
    lines.push_back({rating.method, text_of(rating.plausibility, 2), text_of(rating.vividness, 2)});
  }
  const int raters = ratings.empty() ? 0 : ratings.front().plausibility.n;
  return markdown({"Method", "Plausibility", "Vividness"}, lines) +
         fmt::format("\nMeans over {} rater{}; ±: 95 % confidence interval (Student's t).\n", raters,
                     raters == 1 ? "" : "s");
}

void write_ratings(const std::filesystem::path& report, const std::vector<std::filesystem::path>& answers,
                   Observer& observer) {
  const std::vector<MethodRating> ratings = read_ratings(report / "rating_key.json", answers);
  write_file(report / "ratings.json", ratings_json(ratings));
  write_file(report / "ratings.md", ratings_markdown(ratings));
  observer.say(ratings_markdown(ratings));
  observer.wrote("ratings", report / "ratings.json");
  observer.wrote("ratings", report / "ratings.md");
}

}  // namespace cnerf::compare
