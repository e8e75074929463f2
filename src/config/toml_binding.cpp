#include "src/config/toml_binding.h"

#include <toml++/toml.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <concepts>
#include <numeric>
#include <optional>
#include <sstream>
#include <utility>

#include "src/base/error.h"
#include "src/base/text.h"

namespace cnerf {
namespace {

/// Where a value came from, for messages.
struct Origin {
  std::string source, key;

  [[noreturn]] void refuse(const std::string& problem) const { throw UsageError(source + ": " + key + ": " + problem); }
};

template <typename Number>
std::string shortest_text(Number value) {
  char text[64];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  return {text, end};
}

std::string text_of(const Range& range) {
  return "[" + shortest_text(range.min) + ", " + shortest_text(range.max) + "]" + (range.or_zero ? " or 0" : "");
}

template <std::floating_point Number>
std::string number_text(Number value) {
  const std::string text = shortest_text(value);
  return text.find_first_of(".e") == std::string::npos ? text + ".0" : text;  // TOML tells 1 from 1.0
}

std::string text_of(const toml::node& node) {
  if (const auto* number = node.as_floating_point()) return number_text(number->get());
  std::ostringstream text;
  node.visit([&](const auto& concrete) { text << concrete; });
  return text.str();
}

std::string in_range(const Field& field) {
  return field.range ? " in " + text_of(*field.range) : "";
}

void check_range(const Field& field, double value, const Origin& origin) {
  if (!std::isfinite(value))
    origin.refuse("expected a finite number" + in_range(field) + ", got " + shortest_text(value));
  if (!field.range || (field.range->or_zero && value == 0)) return;
  if (value < field.range->min || value > field.range->max) {
    origin.refuse("expected a number" + in_range(field) + ", got " + shortest_text(value));
  }
}

void assign(const Field&, bool& target, const toml::node& node, const Origin& origin) {
  const auto value = node.value_exact<bool>();
  if (!value) origin.refuse("expected true or false, got " + text_of(node));
  target = *value;
}

void assign(const Field& field, int& target, const toml::node& node, const Origin& origin) {
  const auto value = node.value_exact<std::int64_t>();
  if (!value) origin.refuse("expected an integer" + in_range(field) + ", got " + text_of(node));
  check_range(field, double(*value), origin);
  if (!std::in_range<int>(*value)) origin.refuse("expected a 32-bit integer, got " + text_of(node));
  target = int(*value);
}

template <std::floating_point Number>
void assign(const Field& field, Number& target, const toml::node& node, const Origin& origin) {
  if (!node.is_number()) origin.refuse("expected a number" + in_range(field) + ", got " + text_of(node));
  // The library converts no integers that a double cannot hold.
  const auto* whole = node.as_integer();
  const double value = whole != nullptr ? double(whole->get()) : node.as_floating_point()->get();
  check_range(field, value, origin);
  target = static_cast<Number>(value);
}

void assign(const Field& field, std::string& target, const toml::node& node, const Origin& origin) {
  const auto value = node.value_exact<std::string>();
  const bool allowed = value && (field.choices.empty() || std::ranges::count(field.choices, *value) > 0);
  if (!allowed) {
    const std::string expected = field.choices.empty() ? "a string" : "one of " + joined(field.choices, ", ");
    origin.refuse("expected " + expected + ", got " + text_of(node));
  }
  target = *value;
}

void assign(const Field&, std::vector<std::string>& target, const toml::node& node, const Origin& origin) {
  const toml::array* array = node.as_array();
  if (array == nullptr) origin.refuse("expected a list of strings, got " + text_of(node));
  std::vector<std::string> values;
  for (const toml::node& element : *array) {
    const auto value = element.value_exact<std::string>();
    if (!value) origin.refuse("expected a list of strings, got " + text_of(node));
    values.push_back(*value);
  }
  target = std::move(values);
}

void assign(const Field& field, const toml::node& node, const Origin& origin) {
  std::visit([&](auto* target) { assign(field, *target, node, origin); }, field.value);
}

bool is_section(const std::vector<Field>& fields, const std::string& key) {
  return std::ranges::any_of(fields, [&](const Field& field) { return field.key.starts_with(key + "."); });
}

/// Every option and section, for "[stag1]" as well as for "stage1.stesp".
std::vector<std::string> known_keys(const std::vector<Field>& fields) {
  std::vector<std::string> known;
  for (const Field& field : fields) {
    known.push_back(field.key);
    for (auto dot = field.key.find('.'); dot != std::string::npos; dot = field.key.find('.', dot + 1)) {
      known.push_back(field.key.substr(0, dot));
    }
  }
  return known;
}

std::string last_name(const std::string& key) {
  return key.substr(key.rfind('.') + 1);  // npos + 1 is 0: the whole key
}

/// The key whose last name is `name`; empty when there is none.
std::string key_named(const std::vector<Field>& fields, const std::string& name) {
  const auto match = std::ranges::find_if(fields, [&](const Field& field) { return last_name(field.key) == name; });
  return match == fields.end() ? "" : match->key;
}

/// The key that was probably meant. People leave out the section more often than they mistype a name.
std::string suggestion(const std::vector<Field>& fields, const std::string& key) {
  if (const std::string exact = key_named(fields, last_name(key)); !exact.empty()) return exact;
  if (const std::string nearest = nearest_name(key, known_keys(fields)); !nearest.empty()) return nearest;
  std::vector<std::string> names;
  for (const Field& field : fields) names.push_back(last_name(field.key));
  return key_named(fields, nearest_name(last_name(key), names));
}

[[noreturn]] void refuse_unknown(const std::vector<Field>& fields, const Origin& origin) {
  const std::string meant = suggestion(fields, origin.key);
  origin.refuse("unknown key" + (meant.empty() ? std::string() : "; did you mean '" + meant + "'?"));
}

void assign_key(const std::vector<Field>& fields, const toml::node& node, const Origin& origin) {
  const auto field = std::ranges::find(fields, origin.key, &Field::key);
  if (field != fields.end()) return assign(*field, node, origin);
  if (is_section(fields, origin.key)) origin.refuse("is a section, got " + text_of(node));
  refuse_unknown(fields, origin);
}

void read_table(const toml::table& table, const std::string& prefix, const std::string& source,
                const std::vector<Field>& fields) {
  for (const auto& [name, node] : table) {
    const std::string key = prefix + std::string(name.str());
    if (node.is_table() && is_section(fields, key)) {
      read_table(*node.as_table(), key + ".", source, fields);
    } else {
      assign_key(fields, node, {source, key});
    }
  }
}

toml::table parse(std::string_view text, const std::string& source) {
  try {
    return toml::parse(text, source);
  } catch (const toml::parse_error& error) {
    std::ostringstream message;
    message << source << ": line " << error.source().begin.line << ": " << error.description();
    throw UsageError(message.str());
  }
}

std::string section_of(const std::string& key) {
  const auto dot = key.rfind('.');
  return dot == std::string::npos ? "" : key.substr(0, dot);
}

[[noreturn]] void refuse_retired(const RetiredKey& old, const std::string& value, const std::string& source) {
  const std::string instead = old.now.empty() ? old.instead : "use '" + old.now + "'";
  Origin{source, old.key}.refuse("is no option any more, " + instead + "; got " + value);
}

/// Removes a key from a table, with its section if that is empty then, and returns its value as text; nothing where the
/// key is not there.
std::optional<std::string> take_out(toml::table& table, const std::string& key) {
  const std::string section = section_of(key);
  toml::table* home = section.empty() ? &table : table.at_path(section).as_table();
  const toml::node* node = home != nullptr ? home->get(last_name(key)) : nullptr;
  if (node == nullptr) return std::nullopt;
  std::string value = text_of(*node);
  home->erase(last_name(key));
  if (!section.empty() && home->empty()) take_out(table, section);
  return value;
}

std::string toml_string(const std::string& text) {
  std::ostringstream out;
  out << toml::value<std::string>(text);
  return out.str();
}

std::string value_text(const Field& field) {
  struct Writer {
    std::string operator()(const bool* value) const { return *value ? "true" : "false"; }
    std::string operator()(const int* value) const { return std::to_string(*value); }
    std::string operator()(const float* value) const { return number_text(*value); }
    std::string operator()(const double* value) const { return number_text(*value); }
    std::string operator()(const std::string* value) const { return toml_string(*value); }
    std::string operator()(const std::vector<std::string>* values) const {
      std::string text;
      for (const std::string& value : *values) text += (text.empty() ? "" : ", ") + toml_string(value);
      return "[" + text + "]";
    }
  };
  return std::visit(Writer{}, field.value);
}

/// What stands right of `=` on the command line, as TOML.
std::string setting_as_toml(const Field& field, const std::string& value) {
  const bool is_toml = value.starts_with('"') || value.starts_with('\'') || value.starts_with('[');
  if (is_toml) return value;
  if (std::holds_alternative<std::string*>(field.value)) return toml_string(value);
  if (!std::holds_alternative<std::vector<std::string>*>(field.value)) return value;
  std::string list;
  std::istringstream parts(value);
  for (std::string part; std::getline(parts, part, ',');) list += (list.empty() ? "" : ", ") + toml_string(part);
  return "[" + list + "]";
}

}  // namespace

std::vector<std::string> read_toml(std::string_view text, const std::string& source, const std::vector<Field>& fields,
                                   const std::vector<RetiredKey>& retired, Retired treatment) {
  toml::table table = parse(text, source);
  std::vector<std::pair<RetiredKey, std::string>> found;
  for (const RetiredKey& old : retired) {
    const auto value = take_out(table, old.key);
    if (!value) continue;
    if (treatment == Retired::kRefused) refuse_retired(old, *value, source);
    found.emplace_back(old, *value);
  }
  read_table(table, "", source, fields);
  std::vector<std::string> notes;
  for (const auto& [old, value] : found) {
    const auto successor = std::ranges::find(fields, old.now, &Field::key);
    if (value == old.was || (successor != fields.end() && value_text(*successor) == value)) continue;
    if (old.was.empty()) refuse_retired(old, value, source);
    notes.push_back(source + ": " + old.key + " = " + value + " is no option any more: left out");
  }
  return notes;
}

void apply_setting(std::string_view setting, const std::vector<Field>& fields, const std::vector<RetiredKey>& retired) {
  const auto equals = setting.find('=');
  if (equals == std::string_view::npos) {
    throw UsageError("--set: expected key.path=value, got '" + std::string(setting) + "'");
  }
  const std::string key(setting.substr(0, equals));
  const std::string value(setting.substr(equals + 1));
  const Origin origin{"--set", key};
  const auto old = std::ranges::find(retired, key, &RetiredKey::key);
  if (old != retired.end()) refuse_retired(*old, value, origin.source);
  const auto field = std::ranges::find(fields, key, &Field::key);
  if (field == fields.end() && is_section(fields, key)) origin.refuse("is a section, not an option");
  if (field == fields.end()) refuse_unknown(fields, origin);

  try {
    const toml::table table = toml::parse("value = " + setting_as_toml(*field, value));
    if (table.size() != 1) origin.refuse("expected one value, got '" + value + "'");
    assign(*field, *table.get("value"), origin);
  } catch (const toml::parse_error&) {
    const bool is_text = std::holds_alternative<std::string*>(field->value);
    if (!is_text) origin.refuse("cannot read the value '" + value + "'");
    assign(*field, toml::value<std::string>(value), origin);  // words that only begin as TOML does: '60s kitchen
  }
}

std::string write_toml(const std::vector<Field>& fields) {
  // TOML wants the plain keys of a table before its first sub-table; a stable sort by section keeps the given order.
  std::vector<std::string> sections;
  for (const Field& field : fields) {
    if (std::ranges::count(sections, section_of(field.key)) == 0) sections.push_back(section_of(field.key));
  }
  std::ranges::stable_sort(sections, [](const auto& a, const auto& b) { return a.empty() && !b.empty(); });

  std::string text;
  for (const std::string& section : sections) {
    if (!section.empty()) text += "\n[" + section + "]\n";
    for (const Field& field : fields) {
      if (section_of(field.key) != section) continue;
      const std::string name = section.empty() ? field.key : field.key.substr(section.size() + 1);
      text += name + " = " + value_text(field) + "  # " + field.help + "\n";
    }
  }
  return text;
}

std::string nearest_name(std::string_view word, const std::vector<std::string>& candidates) {
  const auto distance = [&](const std::string& candidate) {
    std::vector<std::size_t> row(candidate.size() + 1);
    std::iota(row.begin(), row.end(), std::size_t{0});
    for (std::size_t i = 1; i <= word.size(); ++i) {
      std::size_t diagonal = std::exchange(row[0], i);
      for (std::size_t j = 1; j <= candidate.size(); ++j) {
        const std::size_t substituted = diagonal + (word[i - 1] == candidate[j - 1] ? 0 : 1);
        diagonal = row[j];
        row[j] = std::min({row[j] + 1, row[j - 1] + 1, substituted});
      }
    }
    return row.back();
  };
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(word.size() / 2, 2) + 1;
  for (const std::string& candidate : candidates) {
    const std::size_t d = distance(candidate);
    if (d < best_distance) {
      best = candidate;
      best_distance = d;
    }
  }
  return best;
}

}  // namespace cnerf
