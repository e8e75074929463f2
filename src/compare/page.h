#pragma once
/// HTML files that need nothing else: a page of src/compare/pages, which draws the JSON that is put into it.

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>

namespace cnerf::compare {

extern const char* const kReportPage;
extern const char* const kRatingPage;

/// The page with its data.
[[nodiscard]] std::string page_with(const char* page, const nlohmann::ordered_json& data);

/// `data:` URI of a picture file.
/// @param type  "jpeg" or "png"
[[nodiscard]] std::string data_uri(const std::string& type, std::span<const std::byte> bytes);

}  // namespace cnerf::compare
