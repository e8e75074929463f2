#include "src/compare/rating.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <nlohmann/json.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/rng.h"

namespace cnerf::compare {
namespace {
namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kScales[] = {"plausibility", "vividness"};

constexpr const char* kStyle = R"css(
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 1100px; margin: 2rem auto; padding: 0 1rem; }
section { display: grid; gap: 14px; grid-template-columns: repeat(auto-fill, minmax(300px, 1fr)); margin: 2rem 0; }
figure { margin: 0; } img { width: 100%; display: block; }
fieldset { border: none; padding: 0; margin: .2rem 0; }
legend { float: left; width: 7rem; } label { margin-right: .6rem; }
figure.missing { outline: 3px solid #c33; }
)css";

constexpr const char* kScript = R"js(
document.querySelector('button').addEventListener('click', () => {
  const answers = [];
  let first = null;
  for (const item of document.querySelectorAll('figure')) {
    const grade = (scale) => Number(item.querySelector(`input[name="${item.id}-${scale}"]:checked`)?.value ?? 0);
    const answer = { item: item.id, plausibility: grade('plausibility'), vividness: grade('vividness') };
    const missing = !answer.plausibility || !answer.vividness;
    item.classList.toggle('missing', missing);
    if (missing) first ??= item;
    answers.push(answer);
  }
  if (first) { first.scrollIntoView(); return; }
  const link = document.createElement('a');
  const sheet = document.body.dataset.sheet;
  const file = new Blob([JSON.stringify({ sheet, answers }, null, 1)], { type: 'application/json' });
  link.href = URL.createObjectURL(file);
  link.download = `answers-${Date.now()}.json`;
  link.click();
});
)js";

template <typename T>
void shuffle(std::vector<T>& values, SequentialRng& rng) {
  for (std::size_t i = values.size(); i > 1; --i) std::swap(values[i - 1], values[rng.below(std::uint32_t(i))]);
}

std::string scale_html(const std::string& item, const char* scale) {
  std::string html = fmt::format("<fieldset><legend>{}</legend>", scale);
  for (int grade = 1; grade <= 5; ++grade) {
    html +=
        fmt::format("<label><input type=\"radio\" name=\"{}-{}\" value=\"{}\">{}</label>", item, scale, grade, grade);
  }
  return html + "</fieldset>";
}

std::string item_html(const std::string& item, const EncodedPicture& picture) {
  std::string html =
      fmt::format("<figure id=\"{}\"><img alt=\"picture {}\" src=\"{}\">", item, item, data_uri(picture));
  for (const char* scale : kScales) html += scale_html(item, scale);
  return html + "</figure>";
}

Json read_json(const fs::path& file) {
  try {
    return Json::parse(read_text_file(file));
  } catch (const nlohmann::json::exception& problem) {
    throw InputError(file.string() + ": " + problem.what());
  }
}

int grade_of(const Json& answer, const char* scale, const std::string& item, const fs::path& file) {
  const auto found = answer.find(scale);
  const bool is_grade = found != answer.end() && found->is_number_integer() && *found >= 1 && *found <= 5;
  if (!is_grade) {
    const std::string got = found == answer.end() ? "nothing" : found->dump();
    throw InputError(file, "item " + item + ": " + scale, "expected a whole number from 1 to 5, got " + got);
  }
  return found->get<int>();
}

/// Sum and count of one rater's grades of a method.
struct Grades {
  double sum[2] = {0, 0};
  int count = 0;
};

std::map<std::string, Grades> grades_of_rater(const Json& key, const fs::path& file) {
  const Json answers = read_json(file);
  const bool is_of_sheet = answers.is_object() && answers.value("sheet", Json()) == key.at("sheet");
  if (!is_of_sheet) throw InputError(file, "sheet", "these answers belong to another rating sheet than the key");
  std::map<std::string, Grades> grades;
  std::map<std::string, bool> seen;
  for (const Json& answer : answers.value("answers", Json::array())) {
    const std::string item = answer.is_object() ? answer.value("item", "") : "";
    const auto entry = key.at("items").find(item);
    if (entry == key.at("items").end()) throw InputError(file, "item " + item, "the sheet has no such picture");
    if (seen[item]) throw InputError(file, "item " + item, "is judged twice");
    seen[item] = true;
    Grades& of_method = grades[entry->at("method").get<std::string>()];
    for (int scale = 0; scale < 2; ++scale) of_method.sum[scale] += grade_of(answer, kScales[scale], item, file);
    of_method.count += 1;
  }
  for (const auto& [item, what] : key.at("items").items()) {
    if (!seen[item]) throw InputError(file, "item " + item, "is not judged");
  }
  return grades;
}

std::string text_of(const Estimate& value) {
  return value.n > 1 ? fmt::format("{:.2f} ± {:.2f}", value.mean, value.half_width) : fmt::format("{:.2f}", value.mean);
}

}  // namespace

RatingSheet make_rating_sheet(std::vector<RatedPicture> pictures, std::uint64_t seed) {
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

  Json items = Json::object();
  std::string sections;
  for (std::vector<RatedPicture>& group : groups) {
    shuffle(group, rng);
    sections += "<section>";
    for (const RatedPicture& picture : group) {
      const std::string item = std::to_string(items.size() + 1);
      items[item] = {{"capture", picture.capture}, {"view", picture.view}, {"method", picture.method}};
      sections += item_html(item, picture.picture);
    }
    sections += "</section>";
  }
  const std::string sheet = sha256(std::as_bytes(std::span(sections))).substr(0, 16);
  const std::string html =
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width\"><title>Rating sheet</title><style>" +
      std::string(kStyle) + "</style></head><body data-sheet=\"" + sheet +
      "\"><h1>Rating sheet</h1><p>Pictures of one view stand together. Please judge each: <b>plausibility</b> (could "
      "the "
      "scene have these colours? 1 = never, 5 = of course) and <b>vividness</b> (are the colours lively? 1 = dull, 5 = "
      "vivid). Then save the answers and send the file back.</p>" +
      sections + "<button>Save the answers</button><script>" + kScript + "</script></body></html>\n";
  return {html, Json{{"sheet", sheet}, {"items", items}}.dump(1) + "\n"};
}

std::vector<MethodRating> read_ratings(const fs::path& key_file, std::span<const fs::path> answers) {
  const Json key = read_json(key_file);
  if (!key.is_object() || !key.contains("sheet") || !key.contains("items")) {
    throw InputError(key_file, "items", "this is no key of a rating sheet");
  }
  std::map<std::string, std::array<std::vector<double>, 2>> means;  // of each rater
  for (const fs::path& file : answers) {
    for (const auto& [method, grades] : grades_of_rater(key, file)) {
      for (std::size_t scale = 0; scale < 2; ++scale) means[method][scale].push_back(grades.sum[scale] / grades.count);
    }
  }
  std::vector<MethodRating> ratings;
  for (const auto& [method, scales] : means) ratings.push_back({method, *estimate(scales[0]), *estimate(scales[1])});
  std::ranges::stable_sort(ratings, std::ranges::greater(), [](const MethodRating& r) { return r.plausibility.mean; });
  return ratings;
}

std::string ratings_json(std::span<const MethodRating> ratings) {
  Json json = {{"schema_version", 1}, {"methods", Json::array()}};
  for (const MethodRating& rating : ratings) {
    Json entry = {{"method", rating.method}, {"raters", rating.plausibility.n}};
    for (const auto& [name, value] :
         {std::pair{"plausibility", rating.plausibility}, {"vividness", rating.vividness}}) {
      entry[name] = {{"mean", value.mean}};
      if (value.n > 1) entry[name]["ci95"] = value.half_width;
    }
    json["methods"].push_back(std::move(entry));
  }
  return json.dump(2) + "\n";
}

std::string ratings_markdown(std::span<const MethodRating> ratings) {
  std::string text = "| Method | Plausibility | Vividness |\n|---|---|---|\n";
  for (const MethodRating& rating : ratings) {
    text += "| " + rating.method + " | " + text_of(rating.plausibility) + " | " + text_of(rating.vividness) + " |\n";
  }
  const int raters = ratings.empty() ? 0 : ratings.front().plausibility.n;
  return text + fmt::format("\nMeans over {} rater{}; ±: 95 % confidence interval (Student's t).\n", raters,
                            raters == 1 ? "" : "s");
}

}  // namespace cnerf::compare
