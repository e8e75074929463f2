#include "bake/out_of_core/journal.h"

#include <unistd.h>

#include <cerrno>
#include <cstdio>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/files.h"

namespace cnerf::bake {
namespace {
namespace fs = std::filesystem;

/// In front of every part; the identity is the first.
struct PartHeader {
  std::uint64_t bytes = 0;
  std::uint64_t checksum = 0;
};

/// FNV-1a, a word at a time: finds what a killed process left half written, not what somebody forged.
std::uint64_t checksum_of(std::span<const std::byte> bytes) {
  constexpr std::uint64_t kPrime = 0x100000001b3;
  std::uint64_t hash = 0xcbf29ce484222325 ^ bytes.size();
  for (std::size_t at = 0; at < bytes.size(); at += sizeof(std::uint64_t)) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + at, std::min(sizeof word, bytes.size() - at));
    hash = (hash ^ word) * kPrime;
    hash ^= hash >> 32;
  }
  return hash;
}

}  // namespace

struct Journal::File {
  std::FILE* stream = nullptr;
  std::string name;
  struct Place {
    long begin = 0;
    std::size_t bytes = 0;
  };
  std::vector<Place> parts;
  long end = 0;  ///< where the next part goes
  std::size_t found = 0;

  ~File() {
    if (stream != nullptr) std::fclose(stream);
  }

  [[noreturn]] void fail(const char* what) const {
    throw OutputError(name + ": " + what + ": " + (errno != 0 ? std::strerror(errno) : "failed"));
  }

  void append(std::span<const std::byte> bytes) {
    const PartHeader header{bytes.size(), checksum_of(bytes)};
    errno = 0;
    const bool written = std::fseek(stream, end, SEEK_SET) == 0 &&
                         std::fwrite(&header, sizeof header, 1, stream) == 1 &&
                         std::fwrite(bytes.data(), 1, bytes.size(), stream) == bytes.size() && std::fflush(stream) == 0;
    if (!written) fail("cannot be written");
    parts.push_back({end + long(sizeof header), bytes.size()});
    end = parts.back().begin + long(bytes.size());
  }

  /// At a place of its own, so that several threads may read.
  [[nodiscard]] bool read(const Place& place, std::vector<std::byte>& bytes) const {
    bytes.resize(place.bytes);
    for (std::size_t done = 0; done < bytes.size();) {
      const ::ssize_t got =
          ::pread(::fileno(stream), bytes.data() + done, bytes.size() - done, place.begin + static_cast<::off_t>(done));
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) return false;
      done += std::size_t(got);
    }
    return true;
  }

  /// The part that begins at `end`, if it is whole.
  [[nodiscard]] bool read_next(std::size_t file_bytes, std::vector<std::byte>& bytes) {
    PartHeader header;
    if (std::fseek(stream, end, SEEK_SET) != 0 || std::fread(&header, sizeof header, 1, stream) != 1) return false;
    const Place place{end + long(sizeof header), header.bytes};
    if (header.bytes > file_bytes || !read(place, bytes) || checksum_of(bytes) != header.checksum) return false;
    parts.push_back(place);
    end = place.begin + long(place.bytes);
    return true;
  }

  void begin(const std::string& identity) {
    end = 0;
    append(std::as_bytes(std::span(identity)));
    parts.clear();
  }

  /// Whether the file was begun under this identity; then also finds its parts.
  [[nodiscard]] bool resume(const std::string& identity) {
    const std::size_t file_bytes = fs::file_size(name);
    std::vector<std::byte> bytes;
    if (!read_next(file_bytes, bytes)) return false;
    if (std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()) != identity) return false;
    parts.clear();
    while (read_next(file_bytes, bytes)) {
    }
    found = parts.size();
    return true;
  }
};

Journal::Journal() : file_(std::make_unique<File>()) {
  file_->name = "temporary file of a bake";
  file_->stream = std::tmpfile();
  if (file_->stream == nullptr) file_->fail("cannot be made");
}

Journal::Journal(const fs::path& file, const std::string& identity) : file_(std::make_unique<File>()) {
  std::error_code failure;
  if (file.has_parent_path()) fs::create_directories(file.parent_path(), failure);
  if (failure) throw OutputError(file.parent_path().string() + ": cannot make the folder: " + failure.message());
  file_->name = file.string();
  file_->stream = std::fopen(file.c_str(), fs::exists(file) ? "r+b" : "w+b");
  if (file_->stream == nullptr) file_->fail("cannot be opened");
  if (!file_->resume(identity)) file_->begin(identity);
  if (::ftruncate(::fileno(file_->stream), file_->end) != 0) file_->fail("cannot be shortened");
}

Journal::~Journal() = default;
Journal::Journal(Journal&&) noexcept = default;
Journal& Journal::operator=(Journal&&) noexcept = default;

std::size_t Journal::size() const {
  return file_->parts.size();
}
std::size_t Journal::found() const {
  return file_->found;
}

void Journal::append(std::size_t number, std::span<const std::byte> bytes) {
  CNERF_CHECK(number == size(), "parts of a bake are made in order");
  file_->append(bytes);
}

std::vector<std::byte> Journal::read_bytes(std::size_t number) const {
  CNERF_CHECK(number < size(), "this part of the bake is not finished");
  std::vector<std::byte> bytes;
  if (!file_->read(file_->parts[number], bytes)) throw InputError(file_->name + ": cannot be read any more");
  return bytes;
}

}  // namespace cnerf::bake
