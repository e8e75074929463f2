#pragma once
/// How an option struct lists its fields for the config binding, the help text and the tests: one member template
///
///     template <typename Visitor>
///     void visit(Visitor&& v) {
///       v("levels", levels, Range{1, 16}, "levels of the hash grid");  // a number with its legal range
///       v("transfer", transfer, Choice{"srgb", "linear"}, "...");      // a string out of a few
///       v("name", name, "...");                                        // bool, std::string or a list of strings
///       v.section("grid", grid);                                       // a nested option struct
///     }
///
/// The defaults are the struct's member initialisers and stand nowhere else.

#include <initializer_list>
#include <string>
#include <vector>

namespace cnerf {

/// Closed range of a numeric option.
struct Range {
  double min, max;
  bool or_zero = false;  ///< 0 is legal as well, below `min`
};

/// The values a string option may take.
struct Choice {
  std::vector<std::string> values;
  Choice(std::initializer_list<const char*> list) : values(list.begin(), list.end()) {}
};

}  // namespace cnerf
