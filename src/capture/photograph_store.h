#pragma once
/// Where the pixels of a capture lie: in memory, or, where they are more than they may take, in a file without a name
/// that the system reads as it is needed. Its page cache is the cache; what a process has touched is let go again.

#include <cstddef>
#include <filesystem>
#include <limits>
#include <memory>
#include <mutex>

#include "src/capture/mono_image.h"

namespace cnerf {

/// How much memory photographs may take.
struct ImageMemory {
  std::size_t most = std::numeric_limits<std::size_t>::max();  ///< bytes; all beyond lies in a file
  std::filesystem::path folder = {};                           ///< that the file is made in; empty: the system's
};

class PhotographStore {
 public:
  /// @param expected  bytes of all images, as far as it is known: where they are too much, all move to the file at once
  explicit PhotographStore(ImageMemory memory, std::size_t expected = 0);
  ~PhotographStore();
  PhotographStore(const PhotographStore&) = delete;
  PhotographStore& operator=(const PhotographStore&) = delete;

  /// Counts an image; once all of them are too much, this one and those that follow move to the file. From any thread.
  /// @throws OutputError  the file cannot be made or written
  void take(MonoImage& image);
  /// Whether there is a file. Then `put` brings those there that came before it was needed, or have changed since.
  [[nodiscard]] bool has_file() const { return file_ != nullptr; }
  void put(MonoImage& image);

  class File;

 private:
  ImageMemory memory_;
  std::mutex mutex_;
  std::size_t taken_ = 0;  // bytes
  std::shared_ptr<File> file_;
};

}  // namespace cnerf
