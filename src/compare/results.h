#pragma once
/// The results of a comparison as files: table.json for programs, table.md for people.

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "src/compare/table.h"

namespace cnerf::compare {

/// What a comparison was made of.
struct Summary {
  std::string colorizer;  ///< spec
  std::string lpips;      ///< network; empty = not measured
  std::string command_line;
};

/// {"schema_version", "colorizer", "lpips", "command_line", "columns", "tables": [{"capture", "rows"}], "duels",
/// "training_times", "cells"}; of several captures, the last table is that of all of them.
[[nodiscard]] nlohmann::ordered_json table_json(std::span<const Cell> cells, const Summary& summary);
/// The rows of each table for people, with the meaning of each number below; report.html has the rest.
[[nodiscard]] std::string table_markdown(std::span<const Cell> cells, const Summary& summary);

/// A table of Markdown; each row has as many texts as `head`.
[[nodiscard]] std::string markdown(const std::vector<std::string>& head,
                                   const std::vector<std::vector<std::string>>& rows);

}  // namespace cnerf::compare
