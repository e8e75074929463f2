#pragma once
/// The comparison as one HTML file that needs nothing else: tables, pictures, a before/after slider, turntables, plots.
/// What it shows is made here; how, by pages/report.html and pages/report.js.

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "src/compare/methods.h"
#include "src/compare/results.h"
#include "src/compare/subject.h"

namespace cnerf::compare {

/// What one method shows of a capture. Pictures are `data:` URIs.
struct ReportMethod {
  struct Gallery {
    std::string title, picture;

    template <typename Self, typename Visitor>
    static void visit(Self& self, Visitor&& v) {
      v("title", self.title);
      v("picture", self.picture);
    }
  };
  std::string name;
  std::vector<std::string> views;      ///< as `ReportCapture::views`; empty when the method failed
  std::vector<std::string> turntable;  ///< frames in order
  std::vector<Gallery> galleries;      ///< of purification

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("name", self.name);
    v("views", self.views);
    v("turntable", self.turntable);
    v("galleries", self.galleries);
  }
};

struct ReportCapture {
  std::string name;
  std::vector<std::string> views;           ///< names
  std::vector<std::string> inputs, truths;  ///< as `views`; truths may be empty
  std::vector<ReportMethod> methods;
  int frames_per_second = 12;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("name", self.name);
    v("views", self.views);
    v("inputs", self.inputs);
    v("truths", self.truths);
    v("methods", self.methods);
    v("frames_per_second", self.frames_per_second);
  }
};

/// What the cells of one seed left of a capture, beside the input and the truth.
/// @param stage2  as configured  @param cells  folder of a capture's seed
[[nodiscard]] ReportCapture exhibit(const Subject& subject, std::span<const Method* const> methods,
                                    const Stage2Options& stage2, const std::filesystem::path& cells);

/// The first shown view by every method beside the input and the truth as one PNG, for documents.
void write_strip(const Subject& subject, std::span<const Method* const> methods, const std::filesystem::path& cells,
                 const std::filesystem::path& file);

[[nodiscard]] std::string report_html(std::span<const Cell> cells, const Summary& summary,
                                      std::span<const ReportCapture> captures);

}  // namespace cnerf::compare
