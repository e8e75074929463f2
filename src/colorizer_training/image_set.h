#pragma once
/// The images a colorizer is trained and judged on, decoded, labelled and split.

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "src/picture/picture.h"

namespace cnerf::colorizer_training {

inline constexpr int kEvaluationSide = 160;         ///< short side of images that are judged, pixels
inline constexpr int kHeldOutParts = 20;            ///< of every set; some of them, chosen by name, are for validation
inline constexpr const char* kTileSet = "objects";  ///< the set of small pictures

/// What images are known to be. Classes of different sets are never compared with each other.
struct ClassList {
  std::vector<std::string> names;               ///< "caltech101/lotus"
  std::vector<std::pair<int, int>> set_ranges;  ///< classes [first, last) of each set that has labels
  [[nodiscard]] int range_of(int label) const;  ///< index into set_ranges; -1 for no label
};

/// Training images of one canvas size. Photographs are squeezed to a square; `aspect` undoes it.
struct TrainingImages {
  int side = 0;
  std::vector<std::uint8_t> rgb;  ///< [N, side, side, 3] sRGB
  std::vector<float> aspect;      ///< [N] width / height of the photograph
  std::vector<int> label;         ///< [N] into ClassList; -1 = unknown

  [[nodiscard]] std::size_t size() const { return aspect.size(); }
};

/// Images to judge, by the set they come from, short side kEvaluationSide.
using EvaluationSets = std::map<std::string, std::vector<Picture>>;

struct ImageSources {
  std::vector<std::filesystem::path> photos;      ///< folders of `set/class/name.ext`; class "-" = unknown
  std::vector<std::filesystem::path> mosaics;     ///< folders of mosaics of square tiles, in this order
  std::filesystem::path mosaic_labels;            ///< .npy, uint8, one per tile; empty = no labels
  std::vector<std::filesystem::path> evaluation;  ///< folders of images that are never trained on
  int tile_side = 64;
  int held_out = 1;  ///< of kHeldOutParts
};

struct ImageSet {
  TrainingImages photos, tiles;
  EvaluationSets validation;  ///< what was held out
  EvaluationSets evaluation;  ///< by the folders' names
  ClassList classes;
};

/// Decodes everything on all cores. Which images are held out depends on their names alone.
/// @throws MissingInputError, InputError  naming the file; images that cannot be decoded are errors, too.
/// @throws UsageError  evaluation folders of one name
[[nodiscard]] ImageSet load_image_set(const ImageSources& sources);

/// All images of a folder at evaluation size, in the order of their names.
[[nodiscard]] std::vector<Picture> load_evaluation_images(const std::filesystem::path& folder);

/// Any aspect; a tent filter, as wide as a target pixel when shrinking and as a source pixel when growing.
[[nodiscard]] Picture resized(const Picture& picture, int width, int height);

}  // namespace cnerf::colorizer_training
