#include "src/compare/results.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "src/base/json_record.h"

namespace cnerf::compare {
namespace {
using Json = nlohmann::ordered_json;

constexpr int kTableSchemaVersion = 1;
template <typename Record>
Json list_of(const std::vector<Record>& records) {
  Json list = Json::array();
  for (const Record& record : records) list.push_back(json_of(record));
  return list;
}

Json row_json(const Row& row) {
  Json json = {{"method", row.method}};
  if (!row.error.empty()) json["error"] = row.error;
  for (std::size_t c = 0; c < row.columns.size(); ++c) {
    if (row.columns[c]) json[columns()[c].name] = json_of(*row.columns[c]);
  }
  return json;
}

std::string rows_markdown(const std::vector<Row>& rows) {
  std::vector<std::string> head = {"Method"};
  for (const Column& column : columns()) {
    head.emplace_back(std::string(column.title) + (column.better > 0 ? " ↑" : column.better < 0 ? " ↓" : ""));
  }
  std::vector<std::vector<std::string>> lines;
  std::string failures;
  for (const Row& row : rows) {
    lines.push_back({row.method});
    for (std::size_t c = 0; c < row.columns.size(); ++c) {
      lines.back().push_back(text_of(row.columns[c], columns()[c].digits));
    }
    if (!row.error.empty()) failures += "\n`" + row.method + "` failed: " + row.error + "\n";
  }
  return markdown(head, lines) + failures;
}

}  // namespace

std::string markdown(const std::vector<std::string>& head, const std::vector<std::vector<std::string>>& rows) {
  const auto line = [](const std::vector<std::string>& texts) {
    return fmt::format("| {} |\n", fmt::join(texts, " | "));
  };
  std::string text = line(head) + "|";
  for (std::size_t c = 0; c < head.size(); ++c) text += "---|";
  text += "\n";
  for (const std::vector<std::string>& row : rows) text += line(row);
  return text;
}

Json table_json(std::span<const Cell> cells, const Summary& summary) {
  Json json = {{"schema_version", kTableSchemaVersion},
               {"colorizer", summary.colorizer},
               {"lpips", summary.lpips},
               {"command_line", summary.command_line}};
  for (const Column& column : columns()) {
    json["columns"].push_back({{"name", column.name},
                               {"title", column.title},
                               {"better", column.better},
                               {"digits", column.digits},
                               {"help", column.help}});
  }
  std::vector<std::string> captures = captures_of(cells);
  if (captures.size() > 1) captures.emplace_back();
  for (const std::string& capture : captures) {
    Json rows = Json::array();
    for (const Row& row : table_rows(cells, capture)) rows.push_back(row_json(row));
    json["tables"].push_back({{"capture", capture.empty() ? "all" : capture}, {"rows", std::move(rows)}});
  }
  json["duels"] = list_of(duels(cells));
  if (const auto races = training_races(cells); !races.empty()) json["training_times"] = list_of(races);
  json["cells"] = list_of(std::vector<Cell>(cells.begin(), cells.end()));
  return json;
}

std::string table_markdown(std::span<const Cell> cells, const Summary& summary) {
  std::string text = "Colorizer: `" + summary.colorizer + "`" +
                     (summary.lpips.empty() ? "; LPIPS not measured (--lpips-weights)" : "; LPIPS: " + summary.lpips) +
                     "\n";
  const std::vector<std::string> captures = captures_of(cells);
  for (const std::string& capture : captures) {
    text += "\n## " + capture + "\n\n" + rows_markdown(table_rows(cells, capture));
  }
  if (captures.size() > 1) text += "\n## All captures\n\n" + rows_markdown(table_rows(cells, ""));
  text += "\n## What the numbers mean\n\n";
  for (const Column& column : columns()) text += fmt::format("* **{}**: {}\n", column.title, column.help);
  text += "* ±: 95 % confidence interval of the mean over seeds (Student's t)\n";
  return text;
}

}  // namespace cnerf::compare
