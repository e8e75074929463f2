#include "src/colorizer_training/tar_reader.h"

#include <algorithm>
#include <cstdlib>
#include <span>
#include <string_view>

#include "src/base/error.h"
#include "src/base/files.h"

namespace cnerf {
namespace fs = std::filesystem;

namespace {

constexpr std::size_t kBlock = 512;

std::string field(std::span<const std::byte> header, std::size_t offset, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(header.data()) + offset, size);
  return std::string(text.substr(0, text.find('\0')));
}

bool is_end_marker(std::span<const std::byte> header) {
  return std::all_of(header.begin(), header.end(), [](std::byte b) { return b == std::byte{0}; });
}

std::vector<NamedBytes> read_tar(const fs::path& file) {
  const std::vector<std::byte> content = read_binary_file(file);
  std::span<const std::byte> rest(content);
  std::vector<NamedBytes> entries;
  while (rest.size() >= kBlock && !is_end_marker(rest.first(kBlock))) {
    const auto header = rest.first(kBlock);
    if (field(header, 257, 5) != "ustar") throw InputError(file, "header", "expected an uncompressed ustar archive");
    const std::size_t size = std::strtoull(field(header, 124, 12).c_str(), nullptr, 8);
    const std::size_t padded = (size + kBlock - 1) / kBlock * kBlock;
    rest = rest.subspan(kBlock);
    if (padded > rest.size()) throw InputError(file.string() + ": the archive is cut short");
    const char type = char(header[156]);
    if (type == '0' || type == '\0') {
      const std::string prefix = field(header, 345, 155), name = field(header, 0, 100);
      entries.push_back(
          {prefix.empty() ? name : prefix + "/" + name, {rest.begin(), rest.begin() + std::ptrdiff_t(size)}});
    }
    rest = rest.subspan(padded);
  }
  return entries;
}

std::vector<NamedBytes> read_folder(const fs::path& folder) {
  std::vector<NamedBytes> entries;
  for (const auto& item : fs::recursive_directory_iterator(folder)) {
    if (!item.is_regular_file()) continue;
    entries.push_back({fs::relative(item.path(), folder).generic_string(), read_binary_file(item.path())});
  }
  std::sort(entries.begin(), entries.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  return entries;
}

}  // namespace

std::vector<NamedBytes> read_tar_or_folder(const fs::path& path) {
  if (!fs::exists(path)) throw MissingInputError(path.string() + ": no such file or folder");
  return fs::is_directory(path) ? read_folder(path) : read_tar(path);
}

}  // namespace cnerf
