#pragma once
/// The comparison as one HTML file that needs nothing else: tables, pictures, a before/after slider, turntables, plots.
/// What it shows is made here; how, by pages/report.html and pages/report.js.

#include <span>
#include <string>
#include <vector>

#include "src/compare/results.h"

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

[[nodiscard]] std::string report_html(std::span<const Cell> cells, const Summary& summary,
                                      std::span<const ReportCapture> captures);

}  // namespace cnerf::compare
