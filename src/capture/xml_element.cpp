#include "src/capture/xml_element.h"

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/capture/stated_values.h"

namespace cnerf {
namespace fs = std::filesystem;

void read_xml(const fs::path& file, pugi::xml_document& document) {
  const std::string text = read_text_file(file);
  const pugi::xml_parse_result result = document.load_buffer(text.data(), text.size());
  if (result) return;
  throw InputError(file, "byte " + std::to_string(result.offset),
                   std::string("expected XML, found: ") + result.description());
}

XmlElement XmlElement::child(const char* name) const {
  const std::string inner = field.empty() ? name : field + "." + name;
  if (!has(name)) throw InputError(*file, inner, "expected an element, found none");
  return {node.child(name), file, inner};
}

double XmlElement::number(const char* name) const {
  const XmlElement element = child(name);
  return number_of(element.node.child_value(), *file, element.field);
}

double XmlElement::number(const char* name, double where_missing) const {
  return has(name) ? number(name) : where_missing;
}

}  // namespace cnerf
