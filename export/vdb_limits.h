#pragma once
/// What reading a VDB file may take.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <system_error>

namespace cnerf::exporting {

struct VdbLimits {
  std::uint64_t memory_bytes;  ///< beside libraries
  std::chrono::seconds cpu;
};

/// A leaf of equal values is some 70 bytes in a file and 24 KiB as voxels, so much memory may be right for a large
/// file, but not for a small one. A summary is made of one grid after another, of those that fit.
[[nodiscard]] inline VdbLimits limits_of(bool is_summary, const std::filesystem::path& file) {
  constexpr std::uint64_t kMiB = 1 << 20, kPerByte = 256;
  std::error_code failure;
  const std::uintmax_t size = std::filesystem::file_size(file, failure);
  const std::uint64_t bytes = failure ? 0 : size;
  return {is_summary ? 384 * kMiB : 512 * kMiB + kPerByte * bytes, std::chrono::seconds(10 + bytes / kMiB)};
}

}  // namespace cnerf::exporting
