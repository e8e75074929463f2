#pragma once
/// What lies behind a file's checksum, taken out, and put back under a checksum that fits.

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace cnerf::mutants {

enum class Format {
  kPlain,     ///< no checksum in the file
  kSnapshot,  ///< src/train/luminance/snapshot.h
  kWeights,   ///< src/colorizer/torch/network_weights.cpp
  kJournal,   ///< bake/out_of_core/journal.cpp
};

struct Section {
  std::string bytes;
  bool is_text = false;
};

struct Envelope {
  std::vector<Section> sections;
  std::function<std::string(const std::vector<Section>&)> seal;  ///< the file that holds these
};

/// @return  nothing where the format has no checksum, or the file is not of it
[[nodiscard]] std::optional<Envelope> opened(Format format, const std::string& file);

}  // namespace cnerf::mutants
