#pragma once
/// Option structs to and from JSON, for snapshot headers. Users' TOML goes through src/config instead.

#include <nlohmann/json.hpp>

#include "src/base/json.h"

namespace cnerf {

class OptionsToJson {
 public:
  template <typename T, typename... Rest>
  void operator()(const char* name, const T& value, const Rest&...) {
    json[name] = value;
  }
  template <typename Nested>
  void section(const char* name, Nested& nested) {
    OptionsToJson inner;
    nested.visit(inner);
    json[name] = inner.json;
  }
  nlohmann::json json = nlohmann::json::object();
};

/// A snapshot of an earlier version lacks the options that came later; they keep their defaults.
class OptionsFromJson {
 public:
  explicit OptionsFromJson(const nlohmann::json& json) : json_(json) {}
  template <typename T, typename... Rest>
  void operator()(const char* name, T& value, const Rest&...) {
    if (const auto found = json_.find(name); found != json_.end()) read_exactly(*found, value);
  }
  template <typename Nested>
  void section(const char* name, Nested& nested) {
    if (const auto found = json_.find(name); found != json_.end()) nested.visit(OptionsFromJson(*found));
  }

 private:
  const nlohmann::json& json_;
};

template <typename Options>
nlohmann::json options_to_json(Options options) {
  OptionsToJson writer;
  options.visit(writer);
  return writer.json;
}

/// @throws nlohmann::json::exception
template <typename Options>
Options options_from_json(const nlohmann::json& json) {
  Options options;
  options.visit(OptionsFromJson(json));
  return options;
}

}  // namespace cnerf
