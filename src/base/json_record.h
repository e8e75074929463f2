#pragma once
/// Conversion of records to and from JSON by their list of fields (src/base/record.h).
///
/// A field is a record itself, a std::optional (left out where it is empty), a std::vector, std::array or
/// std::map<std::string, ...> of fields, a path, or whatever nlohmann::json converts. Keys that no field has are
/// ignored.

#include <array>
#include <charconv>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "src/base/json.h"
#include "src/base/record.h"

namespace cnerf {

namespace json_record {
using Json = nlohmann::ordered_json;

/// A field that is missing or of another type.
struct FieldError : std::runtime_error {
  FieldError(std::string where, const std::string& problem) : std::runtime_error(problem), field(std::move(where)) {}
  std::string field;  ///< "metrics.views[3].psnr_rgb"
};

struct AnyField {
  void operator()(const char* name, auto& field, auto... optional);
};
template <typename T>
concept Record = requires(T& record) {
  T::visit(record, AnyField{});
};

template <typename T>
inline constexpr bool is_optional = false;
template <typename T>
inline constexpr bool is_optional<std::optional<T>> = true;

template <typename T>
inline constexpr bool is_list = false;
template <typename T>
inline constexpr bool is_list<std::vector<T>> = true;
template <typename T, std::size_t N>
inline constexpr bool is_list<std::array<T, N>> = true;

template <typename T>
inline constexpr bool is_map = false;
template <typename T>
inline constexpr bool is_map<std::map<std::string, T>> = true;

template <typename Mark, typename... Marks>
inline constexpr bool has_mark = (std::is_same_v<Mark, Marks> || ...);

/// The number that is written with the fewest digits and read as `value`: as a double, 0.4 would have 16.
inline double with_fewest_digits(float value) {
  std::array<char, 32> text;
  const char* end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  double read = value;
  std::from_chars(text.data(), end, read);
  return float(read) == value ? read : double(value);
}

template <typename T>
Json written(const T& value) {
  if constexpr (Record<const T>) {
    Json json = Json::object();
    T::visit(value, [&]<typename Field, typename... Marks>(const char* name, const Field& field, Marks...) {
      if constexpr (is_optional<Field>) {
        if (field) {
          json[name] = written(*field);
        } else if (has_mark<NullableField, Marks...>) {
          json[name] = nullptr;
        }
      } else if constexpr (has_mark<OptionalField, Marks...>) {
        if (Json text = written(field); text != written(Field{})) json[name] = std::move(text);
      } else {
        json[name] = written(field);
      }
    });
    return json;
  } else if constexpr (is_list<T>) {
    Json json = Json::array();
    for (const auto& element : value) json.push_back(written(element));
    return json;
  } else if constexpr (is_map<T>) {
    Json json = Json::object();
    for (const auto& [name, element] : value) json[name] = written(element);
    return json;
  } else if constexpr (std::is_same_v<T, std::filesystem::path>) {
    return value.string();
  } else if constexpr (std::is_same_v<T, float>) {
    return with_fewest_digits(value);
  } else {
    return value;
  }
}

template <typename T>
void read(const Json& json, const std::string& where, T& value);

template <typename T>
void read_list(const Json& json, const std::string& where, T& list) {
  if (!json.is_array()) throw FieldError(where, "expected a list, got " + excerpt(json));
  if constexpr (requires { list.resize(json.size()); }) list.resize(json.size());
  if (json.size() != list.size()) {
    throw FieldError(where, "expected " + std::to_string(list.size()) + " values, got " + excerpt(json));
  }
  for (std::size_t i = 0; i < list.size(); ++i) read(json[i], where + "[" + std::to_string(i) + "]", list[i]);
}

template <typename T>
void read_record(const Json& json, const std::string& where, T& record) {
  if (!json.is_object()) throw FieldError(where, "expected an object, got " + excerpt(json));
  T::visit(record, [&]<typename Field, typename... Marks>(const char* name, Field& field, Marks...) {
    if constexpr (!has_mark<WrittenField, Marks...>) {
      const std::string inner = where.empty() ? name : where + "." + name;
      const auto found = json.find(name);
      if (found != json.end()) {
        if constexpr (is_optional<Field>) {
          if (found->is_null()) return field.reset();
          read(*found, inner, field.emplace());
        } else {
          read(*found, inner, field);
        }
      } else if (!is_optional<Field> && sizeof...(Marks) == 0) {
        throw FieldError(inner, "is missing");
      }
    }
  });
}

template <typename T>
void read(const Json& json, const std::string& where, T& value) {
  if constexpr (Record<T>) {
    read_record(json, where, value);
  } else if constexpr (is_list<T>) {
    read_list(json, where, value);
  } else if constexpr (is_map<T>) {
    if (!json.is_object()) throw FieldError(where, "expected an object, got " + excerpt(json));
    value.clear();
    for (const auto& [name, element] : json.items())
      read(element, std::string(where).append(1, '.').append(name), value[name]);
  } else if constexpr (std::is_same_v<T, std::filesystem::path>) {
    std::string text;
    read(json, where, text);
    if (text.find('\0') != std::string::npos) throw FieldError(where, "expected a path, got " + excerpt(json));
    value = text;
  } else {
    if (!holds<T>(json)) throw FieldError(where, "got " + excerpt(json));
    try {
      json.get_to(value);
    } catch (const nlohmann::json::exception&) {
      throw FieldError(where, "got " + excerpt(json));
    }
  }
}

}  // namespace json_record

/// A record as JSON, its fields in the order of `visit`.
template <json_record::Record Record>
[[nodiscard]] nlohmann::ordered_json json_of(const Record& record) {
  return json_record::written(record);
}

/// A record out of JSON.
/// @param file  that errors name
/// @throws Problem  "file: field: what is wrong"; any type that is made of a message
template <json_record::Record Record, typename Problem = InputError>
[[nodiscard]] Record record_of(const nlohmann::ordered_json& json, const std::filesystem::path& file) {
  try {
    Record record;
    json_record::read(json, "", record);
    return record;
  } catch (const json_record::FieldError& error) {
    const std::string field = error.field.empty() ? "" : error.field + ": ";
    throw Problem(file.string() + ": " + field + error.what());
  }
}

/// The record that a JSON file holds.  @throws MissingInputError, and Problem as `record_of`.
template <json_record::Record Record, typename Problem = InputError>
[[nodiscard]] Record read_record(const std::filesystem::path& file) {
  return record_of<Record, Problem>(read_json<Problem>(file), file);
}

}  // namespace cnerf
