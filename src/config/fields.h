#pragma once
/// A flat list of the fields of an option struct: where they lie, what they may hold, what they are for. Made by the
/// struct's own `visit` (src/base/options.h), so that reading, writing and help need no knowledge of any struct.

#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "src/base/options.h"

namespace cnerf {

struct Field {
  std::string key;  ///< dotted path, "stage1.grid.levels"
  std::variant<bool*, int*, float*, double*, std::string*, std::vector<std::string>*> value;
  std::optional<Range> range;        ///< of a number
  std::vector<std::string> choices;  ///< of a string; empty = any
  std::string help;
};

/// Visitor that collects fields under a prefix.
class FieldCollector {
 public:
  explicit FieldCollector(std::vector<Field>& fields, std::string prefix = {})
      : fields_(fields), prefix_(std::move(prefix)) {}

  template <typename Number>
  void operator()(const char* name, Number& value, Range range, const char* help) {
    fields_.push_back({prefix_ + name, &value, range, {}, help});
  }
  void operator()(const char* name, std::string& value, const Choice& choice, const char* help) {
    fields_.push_back({prefix_ + name, &value, {}, choice.values, help});
  }
  template <typename Value>
  void operator()(const char* name, Value& value, const char* help) {
    fields_.push_back({prefix_ + name, &value, {}, {}, help});
  }
  template <typename Options>
  void section(const char* name, Options& options) {
    options.visit(FieldCollector(fields_, prefix_ + name + "."));
  }

 private:
  std::vector<Field>& fields_;
  std::string prefix_;
};

/// The fields of `options`, in the order of its `visit`. They point into `options`, which must outlive them.
template <typename Options>
[[nodiscard]] std::vector<Field> fields_of(Options& options) {
  std::vector<Field> fields;
  options.visit(FieldCollector(fields));
  return fields;
}

}  // namespace cnerf
