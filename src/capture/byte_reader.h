#pragma once
/// Reads a binary file value by value and names the file when it ends too early.

#include <bit>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "src/base/error.h"
#include "src/base/files.h"

namespace cnerf {

/// Little-endian values of a file.
class ByteReader {
 public:
  /// @throws MissingInputError, InputError.
  explicit ByteReader(const std::filesystem::path& file) : file_(file), content_(read_binary_file(file)) {
    static_assert(std::endian::native == std::endian::little, "values are copied as they are stored");
  }

  /// The next value.  @param field  what is being read, for the message.  @throws InputError  past the end.
  template <typename T>
  T next(const std::string& field) {
    T value;
    require(sizeof(T), field);
    std::memcpy(&value, content_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return value;
  }
  /// Text up to the next zero byte.
  std::string next_text(const std::string& field) {
    std::string text;
    for (char c = next<char>(field); c != '\0'; c = next<char>(field)) text += c;
    return text;
  }
  /// Skips `count` items of `size` bytes.
  void skip(std::size_t count, std::size_t size, const std::string& field) {
    if (count > (content_.size() - at_) / size) fail(field);
    at_ += count * size;
  }

 private:
  void require(std::size_t bytes, const std::string& field) const {
    if (bytes > content_.size() - at_) fail(field);
  }
  [[noreturn]] void fail(const std::string& field) const {
    throw InputError(file_, field,
                     "expected more data, found the end of the file after " + std::to_string(content_.size()) +
                         " bytes: it is cut short");
  }

  std::filesystem::path file_;
  std::vector<std::byte> content_;
  std::size_t at_ = 0;
};

}  // namespace cnerf
