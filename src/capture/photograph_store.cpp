#include "src/capture/photograph_store.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "src/base/error.h"
#include "src/base/file_descriptor.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

constexpr std::chrono::milliseconds kBetweenLooks{20};
constexpr const char* kAdvice = "; --image-memory says how much of the photographs lies in memory";

/// Pages of files that this process holds in memory, its own libraries' among them; bytes.
std::size_t held_pages_of_files() {
  std::FILE* file = std::fopen("/proc/self/statm", "r");
  if (file == nullptr) return 0;
  unsigned long all = 0, held = 0, of_files = 0;
  const int read = std::fscanf(file, "%lu %lu %lu", &all, &held, &of_files);
  std::fclose(file);
  return read == 3 ? of_files * std::size_t(::sysconf(_SC_PAGESIZE)) : 0;
}

}  // namespace

/// The file, its places in memory, and a thread that lets go of what was touched where it gets too much. What is asked
/// for again the system finds in its page cache, or reads.
class PhotographStore::File {
 public:
  File(const fs::path& folder, std::size_t most) : most_(most), others_(held_pages_of_files()) {
    const fs::path place = folder.empty() ? fs::temp_directory_path() : folder;
    name_ = place.string() + ": a file for photographs";
    number_.reset(::open(place.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600));  // a kill leaves nothing
    if (number_.number() < 0 && errno == EOPNOTSUPP) {                           // on some network shares
      std::string name = (place / "photographs.XXXXXX").string();
      number_.reset(::mkostemp(name.data(), O_CLOEXEC));
      if (number_.number() >= 0) ::unlink(name.c_str());
    }
    if (number_.number() < 0) throw OutputError(name_ + ": " + std::strerror(errno) + kAdvice);
    guard_ = std::thread([this] { guard(); });
  }
  ~File() {
    {
      const std::lock_guard lock(mutex_);
      is_over_ = true;
    }
    changed_.notify_all();
    guard_.join();
    for (const Place& place : places_) ::munmap(place.begin, place.size);
  }

  /// Writes values to the file's end.  @return  where they lie from now on
  const void* add(const void* values, std::size_t bytes) {
    const auto page = std::size_t(::sysconf(_SC_PAGESIZE));
    const std::size_t size = (bytes + page - 1) / page * page;
    std::size_t at = 0;
    {
      const std::lock_guard lock(mutex_);
      at = std::exchange(end_, end_ + size);
    }
    const char* from = static_cast<const char*>(values);
    for (std::size_t done = 0; done < bytes;) {
      const ::ssize_t written = ::pwrite(number_.number(), from + done, bytes - done, ::off_t(at + done));
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) throw OutputError(name_ + ": " + std::strerror(errno) + kAdvice);
      done += std::size_t(written);
    }
    void* begin = ::mmap(nullptr, bytes, PROT_READ, MAP_SHARED, number_.number(), ::off_t(at));
    if (begin == MAP_FAILED) throw OutputError(name_ + ": mmap: " + std::strerror(errno) + kAdvice);
    ::madvise(begin, bytes, MADV_RANDOM);  // steps ask for single pixels
    const std::lock_guard lock(mutex_);
    places_.push_back({begin, bytes});
    return begin;
  }

 private:
  struct Place {
    void* begin;
    std::size_t size;
  };

  void guard() {
    std::unique_lock lock(mutex_);
    while (!changed_.wait_for(lock, kBetweenLooks, [this] { return is_over_; })) {
      if (held_pages_of_files() < others_ + most_) continue;
      for (const Place& place : places_) ::madvise(place.begin, place.size, MADV_DONTNEED);
    }
  }

  std::size_t most_, others_;
  std::string name_;
  FileDescriptor number_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool is_over_ = false;
  std::size_t end_ = 0;
  std::vector<Place> places_;
  std::thread guard_;
};

PhotographStore::PhotographStore(ImageMemory memory, std::size_t expected)
    : memory_(std::move(memory)), taken_(expected > memory_.most ? memory_.most : 0) {}

PhotographStore::~PhotographStore() = default;

void PhotographStore::take(MonoImage& image) {
  {
    const std::lock_guard lock(mutex_);
    taken_ += bytes_of(image);
    if (taken_ <= memory_.most) return;
    if (!file_) file_ = std::make_shared<File>(memory_.folder, memory_.most);
  }
  put(image);
}

void PhotographStore::put(MonoImage& image) {
  const auto move = [&](auto& plane) {
    using Plane = std::remove_reference_t<decltype(plane)>;
    using Value = typename Plane::value_type;
    if (plane.empty() || plane.is_in_file()) return;
    const void* values = file_->add(std::as_const(plane).data(), plane.size() * sizeof(Value));
    plane = Plane(file_, static_cast<const Value*>(values), plane.size());
  };
  move(image.u8);
  move(image.u16);
  move(image.f32);
  move(image.alpha);
  move(image.mask);
}

}  // namespace cnerf
