#pragma once
/// The user study: pictures without names in random order, to be judged from 1 to 5 for plausibility and vividness, and
/// the answers made into a table. What a picture shows stands in a key that raters do not get.

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "src/base/observer.h"
#include "src/compare/table.h"

namespace cnerf::compare {

/// A picture to judge.
struct RatedPicture {
  std::string capture, view, method;
  std::string picture;  ///< `data:` URI
};

struct RatingSheet {
  std::string html;  ///< for raters; saves their answers as a JSON file
  std::string key;   ///< JSON: which item is what
};

/// Pictures of one view of one capture stand together; their order, and that of the views, is drawn from the seed.
[[nodiscard]] RatingSheet make_rating_sheet(std::vector<RatedPicture> pictures, std::uint64_t seed);

/// Means over raters and pictures.
struct MethodRating {
  std::string method;
  Estimate plausibility, vividness;  ///< over raters: each rater's mean over the pictures counts once
};

/// @param answers  files that raters saved
/// @throws MissingInputError, InputError  answers to another sheet, an unknown or missing item, a grade that is not 1
///         to 5; names file and item.
[[nodiscard]] std::vector<MethodRating> read_ratings(const std::filesystem::path& key,
                                                     std::span<const std::filesystem::path> answers);
[[nodiscard]] std::string ratings_json(std::span<const MethodRating> ratings);
[[nodiscard]] std::string ratings_markdown(std::span<const MethodRating> ratings);

/// Makes the tables of the answers to the rating sheet in a report's folder: ratings.json, ratings.md.
/// @throws  as `read_ratings`
void write_ratings(const std::filesystem::path& report, const std::vector<std::filesystem::path>& answers,
                   Observer& observer);

}  // namespace cnerf::compare
