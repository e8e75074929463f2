#pragma once
/// The comparison as one HTML file that needs nothing else: tables, pictures, a before/after slider, turntables, plots.

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "src/compare/table.h"

namespace cnerf::compare {

/// Bytes of a picture file.
struct EncodedPicture {
  std::string type;  ///< "jpeg" or "png"
  std::vector<std::byte> bytes;
};

/// What one method shows of a capture.
struct ReportMethod {
  std::string name;
  std::vector<EncodedPicture> views;      ///< as `ReportCapture::view_names`; empty when the method failed
  std::vector<EncodedPicture> turntable;  ///< frames in order
  struct Gallery {
    std::string title;
    EncodedPicture picture;
  };
  std::vector<Gallery> galleries;  ///< of purification
};

struct ReportCapture {
  std::string name;
  std::vector<std::string> view_names;
  std::vector<EncodedPicture> inputs, truths;  ///< as `view_names`; truths may be empty
  std::vector<ReportMethod> methods;
  int frames_per_second = 12;
};

[[nodiscard]] std::string comparison_html(std::span<const ComparisonCell> cells, const ComparisonSummary& summary,
                                          std::span<const ReportCapture> captures);

/// `data:` URI of a picture.
[[nodiscard]] std::string data_uri(const EncodedPicture& picture);
/// Text as HTML shows it.
[[nodiscard]] std::string html_text(const std::string& text);

}  // namespace cnerf::compare
