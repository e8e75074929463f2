#include "src/capture/npy_reader.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>

#include "src/base/error.h"
#include "src/base/files.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

constexpr std::size_t kLongestHeader = 10'000;  ///< bytes; as NumPy's own limit
constexpr std::size_t kQuoted = 120;            ///< letters of it that messages quote

struct Header {
  std::string dtype;
  bool fortran_order = false;
  std::vector<std::size_t> shape;
  std::size_t size = 0;  ///< bytes before the values
};

/// The part of the file that describes the array: magic, version, length, and a Python dictionary as text.
std::string_view header_text(const fs::path& file, std::span<const std::byte> content, std::size_t& header_size) {
  const auto byte = [&](std::size_t i) { return std::size_t(content[i]); };
  constexpr std::string_view kMagic = "\x93NUMPY";
  if (content.size() < 10 || std::memcmp(content.data(), kMagic.data(), kMagic.size()) != 0) {
    throw InputError(file, "header", "expected a NumPy .npy file, found other bytes");
  }
  const std::size_t version = byte(6);
  if (version < 1 || version > 3) {
    throw InputError(file, "version", "expected 1 to 3, found " + std::to_string(version));
  }
  const std::size_t start = version == 1 ? 10 : 12;
  if (content.size() < start) throw InputError(file, "header", "the file is cut short");
  std::size_t length = byte(8) | byte(9) << 8;
  if (version > 1) length |= byte(10) << 16 | byte(11) << 24;
  if (length > kLongestHeader) {
    throw InputError(file, "header",
                     "expected at most " + std::to_string(kLongestHeader) + " bytes, found " + std::to_string(length));
  }
  header_size = start + length;
  if (header_size > content.size()) throw InputError(file, "header", "the file is cut short");
  return {reinterpret_cast<const char*>(content.data()) + start, length};
}

/// The header's text from the value of `key` on.
std::string_view value_of(const fs::path& file, std::string_view text, const std::string& key) {
  static constexpr std::string_view kBlanks = " \t\n";
  const std::string quoted = "'" + key + "'";
  const auto skip_blanks = [](std::string_view rest) {
    return rest.substr(std::min(rest.find_first_not_of(kBlanks), rest.size()));
  };
  if (const std::size_t at = text.find(quoted); at != std::string_view::npos) {
    const std::string_view rest = skip_blanks(text.substr(at + quoted.size()));
    if (rest.starts_with(':')) return skip_blanks(rest.substr(1));
  }
  throw InputError(file, key, "expected in the header, found " + std::string(text.substr(0, kQuoted)));
}

/// What stands between two marks at the beginning of a value.
std::string_view between(const fs::path& file, std::string_view value, const char* key, char begin, char end) {
  const std::size_t at = value.find(end, 1);
  if (value.starts_with(begin) && at != std::string_view::npos) return value.substr(1, at - 1);
  throw InputError(file, key, "expected a value of the header, found " + std::string(value.substr(0, kQuoted)));
}

std::vector<std::size_t> parse_shape(const fs::path& file, std::string_view text) {
  std::vector<std::size_t> shape;
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  for (auto at = std::ranges::find_if(text, is_digit); at != text.end(); at = std::find_if(at, text.end(), is_digit)) {
    const std::string number(at, std::find_if_not(at, text.end(), is_digit));
    if (number.size() > 12) {
      throw InputError(file, "shape", "expected sizes of a file, found (" + std::string(text.substr(0, kQuoted)) + ")");
    }
    shape.push_back(std::stoull(number));
    at += std::ptrdiff_t(number.size());
  }
  return shape;
}

Header parse_header(const fs::path& file, std::span<const std::byte> content) {
  Header header;
  const std::string_view text = header_text(file, content, header.size);
  header.dtype = between(file, value_of(file, text, "descr"), "descr", '\'', '\'');
  const std::string_view order = value_of(file, text, "fortran_order");
  header.fortran_order = order.starts_with("True");
  if (!header.fortran_order && !order.starts_with("False")) {
    throw InputError(file, "fortran_order", "expected True or False, found " + std::string(order.substr(0, kQuoted)));
  }
  header.shape = parse_shape(file, between(file, value_of(file, text, "shape"), "shape", '(', ')'));
  return header;
}

template <typename T>
std::vector<double> convert(std::span<const std::byte> bytes, std::size_t count) {
  std::vector<double> values(count);
  for (std::size_t i = 0; i < count; ++i) {
    T value;
    std::memcpy(&value, bytes.data() + i * sizeof(T), sizeof(T));
    values[i] = double(value);
  }
  return values;
}

std::size_t element_size(const fs::path& file, const std::string& dtype) {
  if (dtype == "<f8" || dtype == "<i8") return 8;
  if (dtype == "<f4" || dtype == "<i4") return 4;
  throw InputError(file, "descr", "expected <f8, <f4, <i8 or <i4, found " + dtype);
}

std::vector<double> read_values(const std::string& dtype, std::span<const std::byte> bytes, std::size_t count) {
  if (dtype == "<f8") return convert<double>(bytes, count);
  if (dtype == "<f4") return convert<float>(bytes, count);
  if (dtype == "<i8") return convert<std::int64_t>(bytes, count);
  return convert<std::int32_t>(bytes, count);
}

/// Reorders values whose first index runs fastest into the order whose last index does.
std::vector<double> c_order(const std::vector<double>& values, const std::vector<std::size_t>& shape) {
  std::vector<double> out(values.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    std::size_t rest = i;
    std::size_t source = 0;
    std::size_t stride = values.size();
    for (std::size_t axis = shape.size(); axis-- > 0;) {
      stride /= shape[axis];
      source += rest % shape[axis] * stride;
      rest /= shape[axis];
    }
    out[i] = values[source];
  }
  return out;
}

}  // namespace

NpyArray read_npy(const fs::path& file) {
  const std::vector<std::byte> content = read_binary_file(file);
  const Header header = parse_header(file, content);
  const std::size_t size = element_size(file, header.dtype);
  const std::size_t available = (content.size() - header.size) / size;
  std::size_t count = 1;
  const auto check_count = [&] {
    if (count <= available) return;
    throw InputError(file, "values",
                     "the shape needs at least " + std::to_string(count) + ", found " + std::to_string(available) +
                         ": the file is cut short");
  };
  check_count();  // of an array without axes, which holds one value
  for (const std::size_t extent : header.shape) {
    count *= extent;
    check_count();  // at each step, so that a senseless shape cannot overflow
  }
  NpyArray array;
  array.shape = header.shape;
  array.values = read_values(header.dtype, std::span(content).subspan(header.size), count);
  if (header.fortran_order) array.values = c_order(array.values, array.shape);
  return array;
}

}  // namespace cnerf
