#include "src/compare/report.h"

#include <algorithm>

#include "src/base/json_record.h"
#include "src/compare/methods.h"
#include "src/compare/page.h"

namespace cnerf::compare {

std::string report_html(std::span<const Cell> cells, const Summary& summary, std::span<const ReportCapture> captures) {
  nlohmann::ordered_json data = {{"table", table_json(cells, summary)},
                                 {"methods", nlohmann::ordered_json::array()},
                                 {"captures", nlohmann::ordered_json::array()}};
  for (const Method& method : kMethods) {
    if (std::ranges::find(cells, std::string(method.name), &Cell::method) == cells.end()) continue;
    data["methods"].push_back({{"name", method.name}, {"summary", method.summary}});
  }
  for (const ReportCapture& capture : captures) data["captures"].push_back(to_json(capture));
  return page_with(kReportPage, data);
}

}  // namespace cnerf::compare
