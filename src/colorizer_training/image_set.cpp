#include "src/colorizer_training/image_set.h"

#include <torch/torch.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/parallel.h"
#include "src/base/rng.h"
#include "src/colorizer/torch/torch_threads.h"
#include "src/picture/codecs.h"

namespace cnerf::colorizer_training {
namespace fs = std::filesystem;
namespace {

constexpr int kPhotoCanvas = 176;  // side of a training photograph's square canvas, pixels
constexpr const char* kUnlabelled[] = {"-", "BACKGROUND_Google"};

bool is_held_out(const std::string& name, int parts) {
  std::uint64_t hash = 0xcbf29ce484222325ull;  // FNV-1a
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3ull;
  return int(mix_bits(hash) % kHeldOutParts) < parts;
}

/// Paths of all files below a folder, '/' between their parts, sorted.
std::vector<std::string> files_below(const fs::path& folder) {
  if (!fs::is_directory(folder)) throw MissingInputError(folder.string() + ": no such folder");
  std::vector<std::string> names;
  for (const auto& item : fs::recursive_directory_iterator(folder)) {
    if (item.is_regular_file()) names.push_back(fs::relative(item.path(), folder).generic_string());
  }
  std::ranges::sort(names);
  return names;
}

Picture load_picture(const fs::path& file) {
  const std::vector<std::byte> content = read_binary_file(file);
  cv::Mat image;
  if (!content.empty()) {
    const cv::Mat bytes(1, int(content.size()), CV_8U, const_cast<std::byte*>(content.data()));
    image = decode_image(bytes, cv::IMREAD_COLOR);
  }
  if (image.empty()) throw InputError(file, "", "not an image of a known format");
  cv::cvtColor(image, image, cv::COLOR_BGR2RGB);
  return {image.cols, image.rows, {image.datastart, image.dataend}};
}

/// `task(i)` for i in [0, count) on all cores, one thread for each operator.
template <typename Task>
void on_all_cores(std::size_t count, const Task& task) {
  const SingleThreadedOps single;
  parallel_tasks(count, [&](std::size_t i) {
    at::init_num_threads();
    task(i);
  });
}

Picture at_evaluation_size(const Picture& picture) {
  const double scale = double(kEvaluationSide) / std::min(picture.width, picture.height);
  // Multiples of four: the network answers in blocks of 4x4.
  const auto scaled = [&](int side) { return std::max(kEvaluationSide, int(std::lround(side * scale / 4)) * 4); };
  return resized(picture, scaled(picture.width), scaled(picture.height));
}

struct PhotoName {
  std::string set, label;  ///< label "set/class", or empty
};

PhotoName parse_photo_name(const std::string& name) {
  const std::size_t first = name.find('/');
  if (first == std::string::npos) return {"photos", ""};
  const std::size_t second = name.find('/', first + 1);
  PhotoName parsed{name.substr(0, first), ""};
  if (second == std::string::npos) return parsed;
  const std::string label = name.substr(first + 1, second - first - 1);
  if (std::ranges::find(kUnlabelled, label) == std::end(kUnlabelled)) parsed.label = parsed.set + "/" + label;
  return parsed;
}

struct DecodedPhoto {
  std::string name;
  Picture picture;  ///< canvas or evaluation size
  float aspect = 1;
  bool held_out = false;
};

std::vector<DecodedPhoto> decode_photos(const std::vector<fs::path>& folders, int held_out) {
  std::vector<DecodedPhoto> photos;
  for (const fs::path& folder : folders) {
    const std::vector<std::string> names = files_below(folder);
    const std::size_t first = photos.size();
    photos.resize(first + names.size());
    on_all_cores(names.size(), [&](std::size_t i) {
      const Picture picture = load_picture(folder / names[i]);
      DecodedPhoto& photo = photos[first + i];
      photo.name = names[i];
      photo.aspect = float(picture.width) / float(picture.height);
      photo.held_out = is_held_out(photo.name, held_out);
      photo.picture = photo.held_out ? at_evaluation_size(picture) : resized(picture, kPhotoCanvas, kPhotoCanvas);
    });
  }
  return photos;
}

std::map<std::string, int> number_labels(const std::vector<DecodedPhoto>& photos, ClassList& classes) {
  std::set<std::string> labels;
  for (const auto& photo : photos) labels.insert(parse_photo_name(photo.name).label);
  labels.erase("");
  std::map<std::string, int> numbers;
  std::string current_set;
  for (const std::string& label : labels) {
    const int number = int(classes.names.size());
    if (const std::string set = label.substr(0, label.find('/')); set != current_set) {
      classes.set_ranges.emplace_back(number, number);
      current_set = set;
    }
    numbers[label] = number;
    classes.names.push_back(label);
    classes.set_ranges.back().second = number + 1;
  }
  return numbers;
}

void add_training_image(const std::vector<std::uint8_t>& rgb, float aspect, int label, TrainingImages& images) {
  images.rgb.insert(images.rgb.end(), rgb.begin(), rgb.end());
  images.aspect.push_back(aspect);
  images.label.push_back(label);
}

void add_photos(const ImageSources& sources, ImageSet& set) {
  set.photos.side = kPhotoCanvas;
  std::vector<DecodedPhoto> photos = decode_photos(sources.photos, sources.held_out);
  const std::map<std::string, int> numbers = number_labels(photos, set.classes);
  for (auto& photo : photos) {
    const PhotoName name = parse_photo_name(photo.name);
    if (photo.held_out) {
      set.validation[name.set].push_back(std::move(photo.picture));
    } else {
      add_training_image(photo.picture.rgb, photo.aspect, name.label.empty() ? -1 : numbers.at(name.label), set.photos);
    }
  }
}

/// One byte per tile: the data of a version 1 .npy file of uint8.
std::vector<int> read_labels(const fs::path& file) {
  const std::vector<std::byte> content = read_binary_file(file);
  if (content.size() < 10) throw InputError(file.string() + ": not a .npy file");
  const std::string header(reinterpret_cast<const char*>(content.data()), std::min<std::size_t>(content.size(), 128));
  if (header.find("|u1") == std::string::npos) throw InputError(file, "dtype", "expected uint8 labels (|u1)");
  const std::size_t begin = 10 + (std::size_t(content[9]) << 8 | std::size_t(content[8]));
  std::vector<int> labels;
  for (std::size_t i = begin; i < content.size(); ++i) labels.push_back(int(content[i]));
  return labels;
}

/// The tiles of a mosaic, row by row.
std::vector<Picture> tiles_of(const Picture& mosaic, int side) {
  std::vector<Picture> tiles;
  const cv::Mat whole(mosaic.height, mosaic.width, CV_8UC3, const_cast<std::uint8_t*>(mosaic.rgb.data()));
  for (int y = 0; y + side <= mosaic.height; y += side) {
    for (int x = 0; x + side <= mosaic.width; x += side) {
      const cv::Mat tile = whole(cv::Rect(x, y, side, side)).clone();
      tiles.push_back({side, side, {tile.datastart, tile.dataend}});
    }
  }
  return tiles;
}

void add_mosaics(const ImageSources& sources, ImageSet& set) {
  set.tiles.side = sources.tile_side;
  const auto labels = sources.mosaic_labels.empty() ? std::vector<int>{} : read_labels(sources.mosaic_labels);
  const int first_class = int(set.classes.names.size());
  std::size_t number = 0;
  for (const fs::path& folder : sources.mosaics) {
    const std::vector<std::string> names = files_below(folder);
    std::vector<Picture> mosaics(names.size());
    on_all_cores(names.size(), [&](std::size_t i) { mosaics[i] = load_picture(folder / names[i]); });
    for (const Picture& mosaic : mosaics) {
      for (const Picture& tile : tiles_of(mosaic, sources.tile_side)) {
        const int label = number < labels.size() ? first_class + labels[number] : -1;
        if (is_held_out(std::string(kTileSet) + "/" + std::to_string(number++), sources.held_out)) {
          set.validation[kTileSet].push_back(at_evaluation_size(tile));
        } else {
          add_training_image(tile.rgb, 1, label, set.tiles);
        }
      }
    }
  }
  if (labels.empty() || number == 0) return;
  const int count = 1 + *std::ranges::max_element(labels);
  for (int i = 0; i < count; ++i) set.classes.names.push_back(std::string(kTileSet) + "/" + std::to_string(i));
  set.classes.set_ranges.emplace_back(first_class, first_class + count);
}

}  // namespace

int ClassList::range_of(int label) const {
  for (std::size_t i = 0; i < set_ranges.size(); ++i) {
    if (label >= set_ranges[i].first && label < set_ranges[i].second) return int(i);
  }
  return -1;
}

ImageSet load_image_set(const ImageSources& sources) {
  ImageSet set;
  add_photos(sources, set);
  add_mosaics(sources, set);
  for (const fs::path& folder : sources.evaluation) {
    const std::string name = fs::absolute(folder / "").lexically_normal().parent_path().filename().string();
    const auto [place, is_new] = set.evaluation.try_emplace(name);
    if (!is_new) throw UsageError("--evaluation: two folders are called " + name + ", and scores go by that name");
    place->second = load_evaluation_images(folder);
  }
  return set;
}

std::vector<Picture> load_evaluation_images(const fs::path& folder) {
  const std::vector<std::string> names = files_below(folder);
  std::vector<Picture> pictures(names.size());
  on_all_cores(names.size(), [&](std::size_t i) { pictures[i] = at_evaluation_size(load_picture(folder / names[i])); });
  return pictures;
}

Picture resized(const Picture& picture, int width, int height) {
  namespace F = torch::nn::functional;
  if (picture.width == width && picture.height == height) return picture;
  const torch::NoGradGuard no_grad;
  auto* bytes = const_cast<std::uint8_t*>(picture.rgb.data());
  const torch::Tensor whole = torch::from_blob(bytes, {1, picture.height, picture.width, 3}, torch::kUInt8);
  const auto options = F::InterpolateFuncOptions()
                           .size(std::vector<std::int64_t>{height, width})
                           .mode(torch::kBilinear)
                           .align_corners(false)
                           .antialias(true);
  const torch::Tensor values = F::interpolate(whole.permute({0, 3, 1, 2}).to(torch::kFloat32).contiguous(), options);
  const torch::Tensor codes = values.permute({0, 2, 3, 1}).round().clamp(0, 255).to(torch::kUInt8).contiguous();
  const auto* first = codes.data_ptr<std::uint8_t>();
  return {width, height, {first, first + codes.numel()}};
}

}  // namespace cnerf::colorizer_training
