#pragma once
/// Elements of XML files, and what messages call them.

#include <filesystem>
#include <pugixml.hpp>
#include <string>

namespace cnerf {

/// Reads a whole file; entities that it declares and files that it refers to are not looked at.
/// @throws MissingInputError, InputError.
void read_xml(const std::filesystem::path& file, pugi::xml_document& document);

/// An element of a document that outlives it.
struct XmlElement {
  pugi::xml_node node;
  const std::filesystem::path* file = nullptr;
  std::string field;  ///< "sensor 0.calibration"; for messages

  [[nodiscard]] bool has(const char* name) const { return !node.child(name).empty(); }
  /// @throws InputError  where there is none.
  [[nodiscard]] XmlElement child(const char* name) const;
  /// The number that a child holds.  @throws InputError  where it holds another text, or there is no such child.
  [[nodiscard]] double number(const char* name) const;
  [[nodiscard]] double number(const char* name, double where_missing) const;
};

}  // namespace cnerf
