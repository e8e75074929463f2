#pragma once
/// The images a colorizer is trained and judged on, decoded, labelled and split. No Torch.

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "src/colorizer_training/rgb_image.h"

namespace cnerf {

inline constexpr int kPhotoCanvas = 176;     ///< side of a training photograph's square canvas, pixels
inline constexpr int kEvaluationSide = 160;  ///< short side of images that are judged, pixels
inline constexpr int kHeldOutParts = 20;     ///< of every set; some of them, chosen by name, are for validation

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
  std::vector<double> weight;     ///< [N] how often an image is drawn, relative to others; empty = all the same

  [[nodiscard]] std::size_t size() const { return aspect.size(); }
};

/// Images to judge, by the set they come from, short side kEvaluationSide.
using EvaluationSets = std::map<std::string, std::vector<RgbImage>>;

struct ImageSources {
  std::vector<std::filesystem::path> photos;   ///< tars or folders of `set/class/name.ext`; class "-" = unknown
  std::vector<std::filesystem::path> mosaics;  ///< tars or folders of mosaics of square tiles, in this order
  std::filesystem::path mosaic_labels;         ///< .npy, uint8, one a tile; empty = no labels
  int tile_side = 64;
  int held_out = 1;           ///< of kHeldOutParts
  bool balance_sets = false;  ///< draw a set of n photographs sqrt(n), not n, times as often as one of a single one
};

struct ImageSet {
  TrainingImages photos, tiles;
  EvaluationSets validation;
  ClassList classes;
};

/// Decodes everything on all cores. Which images are held out depends on their names alone.
/// @throws MissingInputError, InputError  naming the file; images that cannot be decoded are errors, too.
[[nodiscard]] ImageSet load_image_set(const ImageSources& sources);

/// All images of a tar or folder at evaluation size, for sets that are never trained on.
[[nodiscard]] std::vector<RgbImage> load_evaluation_images(const std::filesystem::path& path);

}  // namespace cnerf
