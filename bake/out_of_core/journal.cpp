#include "bake/out_of_core/journal.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <mutex>

#include "bake/out_of_core/journal_checksum.h"
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

}  // namespace

struct Journal::File {
  std::FILE* stream = nullptr;
  std::string name;
  struct Place {
    long begin = 0;
    std::size_t bytes = 0;
    std::uint64_t checksum = 0;
  };
  std::mutex mutex;  ///< of `parts`, between who writes and who reads
  std::vector<Place> parts;
  std::string identity;
  long end = 0;  ///< where the next part goes
  std::size_t found = 0;

  ~File() {
    if (stream != nullptr) std::fclose(stream);
  }

  [[noreturn]] void fail(const char* what) const {
    throw OutputError(name + ": " + what + ": " + (errno != 0 ? std::strerror(errno) : "failed"));
  }

  [[nodiscard]] std::uint64_t checksum_at(std::size_t number, std::span<const std::byte> bytes) const {
    return part_checksum(std::as_bytes(std::span(identity)), number, bytes);
  }

  void append(std::span<const std::byte> bytes) {
    const PartHeader header{bytes.size(), checksum_at(parts.size(), bytes)};
    errno = 0;
    const bool written =
        std::fseek(stream, end, SEEK_SET) == 0 && std::fwrite(&header, sizeof header, 1, stream) == 1 &&
        (bytes.empty() || std::fwrite(bytes.data(), bytes.size(), 1, stream) == 1) && std::fflush(stream) == 0;
    if (!written) fail("cannot be written");
    const std::lock_guard lock(mutex);
    parts.push_back({end + long(sizeof header), bytes.size(), header.checksum});
    end = parts.back().begin + long(bytes.size());
  }

  [[nodiscard]] Place place(std::size_t number) {
    const std::lock_guard lock(mutex);
    return parts[number];
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

  /// The part that begins at `end`, if it is whole and this bake's.
  [[nodiscard]] bool read_next(std::size_t file_bytes, std::vector<std::byte>& bytes) {
    PartHeader header;
    if (std::fseek(stream, end, SEEK_SET) != 0 || std::fread(&header, sizeof header, 1, stream) != 1) return false;
    const Place place{end + long(sizeof header), header.bytes, header.checksum};
    if (header.bytes > file_bytes || !read(place, bytes) || checksum_at(parts.size(), bytes) != header.checksum)
      return false;
    parts.push_back(place);
    end = place.begin + long(place.bytes);
    return true;
  }

  void begin() {
    end = 0;
    found = 0;
    parts.clear();
    append(std::as_bytes(std::span(identity)));
    parts.clear();
    if (::ftruncate(::fileno(stream), end) != 0) fail("cannot be shortened");
  }

  /// Whether the file was begun under this identity; then also finds its parts.
  [[nodiscard]] bool resume() {
    struct stat state {};
    if (::fstat(::fileno(stream), &state) != 0) fail("cannot be read");
    const auto file_bytes = std::size_t(state.st_size);
    std::vector<std::byte> bytes;
    if (!read_next(file_bytes, bytes)) return false;
    if (std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()) != identity) return false;
    parts.clear();
    while (read_next(file_bytes, bytes)) {
    }
    found = parts.size();
    if (::ftruncate(::fileno(stream), end) != 0) fail("cannot be shortened");
    return true;
  }

  /// Neither through a link, which may lead to any file of the user's, nor anything but a file.
  void open() {
    const int descriptor = ::open(name.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0644);
    struct stat state {};
    if (descriptor < 0 || ::fstat(descriptor, &state) != 0) fail("cannot be opened");
    stream = ::fdopen(descriptor, "r+b");
    errno = 0;
    if (stream == nullptr || !S_ISREG(state.st_mode)) fail("is no file to write to");
  }
};

Journal::Journal() : file_(std::make_unique<File>()) {
  file_->name = "temporary file of a bake";
  file_->stream = std::tmpfile();
  if (file_->stream == nullptr) file_->fail("cannot be made");
}

Journal::Journal(const fs::path& file, const std::string& identity) : file_(std::make_unique<File>()) {
  if (file.has_parent_path()) make_folders(file.parent_path());
  file_->name = file.string();
  file_->identity = identity;
  file_->open();
  if (!file_->resume()) file_->begin();
}

Journal::~Journal() = default;
Journal::Journal(Journal&&) noexcept = default;
Journal& Journal::operator=(Journal&&) noexcept = default;

std::size_t Journal::size() const {
  const std::lock_guard lock(file_->mutex);
  return file_->parts.size();
}
std::size_t Journal::found() const {
  return file_->found;
}

std::size_t Journal::finished_of_rank_0() const {
  if (ranks_->is_alone()) return size();
  std::size_t finished = 0;
  const cluster::Bytes said = ranks_->broadcast(cluster::Packer().add(size()).packed());
  cluster::Unpacker(said).get(finished);
  return finished;
}

std::exception_ptr Journal::failure_of(std::future<void>& work) {
  try {
    if (work.valid()) work.get();
  } catch (...) {
    return std::current_exception();
  }
  return nullptr;
}

void Journal::hear_of_refusals(std::exception_ptr& failure) const {
  bool refuses = false;
  try {
    if (failure) std::rethrow_exception(failure);
  } catch (const JournalError&) {
    refuses = true;
  } catch (...) {
    refuses = false;  // this rank ends, and the others hear why
  }
  if (ranks_->any(refuses) && !failure) {
    failure = std::make_exception_ptr(JournalError("unfinished.bake holds what this bake cannot have made"));
  }
}

void Journal::restart() {
  file_->begin();
}

void Journal::append(std::size_t number, std::span<const std::byte> bytes) {
  CNERF_CHECK(number == size(), "parts of a bake are made in order");
  file_->append(bytes);
}

std::vector<std::byte> Journal::read_bytes(std::size_t number) const {
  CNERF_CHECK(number < size(), "this part of the bake is not finished");
  std::vector<std::byte> bytes;
  const File::Place place = file_->place(number);
  if (!file_->read(place, bytes) || file_->checksum_at(number, bytes) != place.checksum) {
    throw JournalError(file_->name + ": part " + std::to_string(number) + " was changed since it was written");
  }
  return bytes;
}

void Journal::refuse(std::size_t number) const {
  throw JournalError(file_->name + ": part " + std::to_string(number) + " is none that this bake can have made");
}

}  // namespace cnerf::bake
