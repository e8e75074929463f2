#include "src/colorizer_training/image_set.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <functional>
#include <mutex>
#include <set>
#include <thread>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/rng.h"
#include "src/colorizer_training/tar_reader.h"

namespace cnerf {
namespace fs = std::filesystem;

namespace {

constexpr const char* kTileSet = "objects";
constexpr const char* kUnlabelled[] = {"-", "BACKGROUND_Google"};

/// `task(i)` for i in [0, count) on all cores; the first exception is rethrown.
void on_all_cores(std::size_t count, const std::function<void(std::size_t)>& task) {
  std::atomic<std::size_t> next = 0;
  std::exception_ptr failure;
  std::mutex failure_mutex;
  const auto work = [&] {
    try {
      for (std::size_t i = next++; i < count; i = next++) task(i);
    } catch (...) {
      const std::lock_guard lock(failure_mutex);
      failure = std::current_exception();
      next = count;
    }
  };
  std::vector<std::thread> threads(std::max(1u, std::thread::hardware_concurrency()));
  for (auto& thread : threads) thread = std::thread(work);
  for (auto& thread : threads) thread.join();
  if (failure) std::rethrow_exception(failure);
}

bool is_held_out(const std::string& name, int parts) {
  std::uint64_t hash = 0xcbf29ce484222325ull;  // FNV-1a
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3ull;
  return int(mix_bits(hash) % kHeldOutParts) < parts;
}

RgbImage decode_or_throw(const fs::path& source, const NamedBytes& entry) {
  auto image = decode_image(entry.content);
  if (!image) throw InputError(source, entry.name, "not an image of a known format");
  return *std::move(image);
}

RgbImage at_evaluation_size(const RgbImage& image) {
  const double scale = double(kEvaluationSide) / image.short_side();
  // Multiples of four: the network answers in blocks of 4x4.
  const auto scaled = [&](int side) { return std::max(kEvaluationSide, int(std::lround(side * scale / 4)) * 4); };
  return resize_image(image, scaled(image.width), scaled(image.height));
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
  if (std::find(std::begin(kUnlabelled), std::end(kUnlabelled), label) == std::end(kUnlabelled)) {
    parsed.label = parsed.set + "/" + label;
  }
  return parsed;
}

struct DecodedPhoto {
  std::string name;
  RgbImage image;  ///< canvas or evaluation size
  float aspect = 1;
  bool held_out = false;
};

std::vector<DecodedPhoto> decode_photos(const std::vector<fs::path>& sources, int held_out) {
  std::vector<DecodedPhoto> photos;
  for (const fs::path& source : sources) {
    const std::vector<NamedBytes> entries = read_tar_or_folder(source);
    const std::size_t first = photos.size();
    photos.resize(first + entries.size());
    on_all_cores(entries.size(), [&](std::size_t i) {
      const RgbImage image = decode_or_throw(source, entries[i]);
      DecodedPhoto& photo = photos[first + i];
      photo.name = entries[i].name;
      photo.aspect = float(image.width) / float(image.height);
      photo.held_out = is_held_out(photo.name, held_out);
      photo.image = photo.held_out ? at_evaluation_size(image) : resize_image(image, kPhotoCanvas, kPhotoCanvas);
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

/// Otherwise small sets of whole scenes drown in large ones of single things.
void weigh_by_set(const std::vector<std::string>& set_of_photo, TrainingImages& photos) {
  std::map<std::string, double> counts;
  for (const std::string& name : set_of_photo) counts[name] += 1;
  for (const std::string& name : set_of_photo) photos.weight.push_back(1 / std::sqrt(counts[name]));
}

void add_photos(const ImageSources& sources, ImageSet& set) {
  set.photos.side = kPhotoCanvas;
  std::vector<DecodedPhoto> photos = decode_photos(sources.photos, sources.held_out);
  const std::map<std::string, int> numbers = number_labels(photos, set.classes);
  std::vector<std::string> set_of_photo;
  for (auto& photo : photos) {
    const PhotoName name = parse_photo_name(photo.name);
    if (photo.held_out) {
      set.validation[name.set].push_back(std::move(photo.image));
      continue;
    }
    set.photos.rgb.insert(set.photos.rgb.end(), photo.image.rgb.begin(), photo.image.rgb.end());
    set.photos.aspect.push_back(photo.aspect);
    set.photos.label.push_back(name.label.empty() ? -1 : numbers.at(name.label));
    set_of_photo.push_back(name.set);
  }
  if (sources.balance_sets) weigh_by_set(set_of_photo, set.photos);
}

/// One byte a tile: the data of a version 1 .npy file of uint8.
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

void add_tile(const RgbImage& tile, const std::string& name, int label, int held_out, ImageSet& set) {
  if (is_held_out(name, held_out)) {
    set.validation[kTileSet].push_back(at_evaluation_size(tile));
    return;
  }
  set.tiles.rgb.insert(set.tiles.rgb.end(), tile.rgb.begin(), tile.rgb.end());
  set.tiles.aspect.push_back(1);
  set.tiles.label.push_back(label);
}

void add_mosaics(const ImageSources& sources, ImageSet& set) {
  set.tiles.side = sources.tile_side;
  const std::vector<int> labels =
      sources.mosaic_labels.empty() ? std::vector<int>{} : read_labels(sources.mosaic_labels);
  const int first_class = int(set.classes.names.size());
  int tile_number = 0;
  for (const fs::path& source : sources.mosaics) {
    const std::vector<NamedBytes> entries = read_tar_or_folder(source);
    std::vector<RgbImage> mosaics(entries.size());
    on_all_cores(entries.size(), [&](std::size_t i) { mosaics[i] = decode_or_throw(source, entries[i]); });
    for (const RgbImage& mosaic : mosaics) {
      for (int y = 0; y + sources.tile_side <= mosaic.height; y += sources.tile_side) {
        for (int x = 0; x + sources.tile_side <= mosaic.width; x += sources.tile_side, ++tile_number) {
          const bool labelled = std::size_t(tile_number) < labels.size();
          add_tile(crop_image(mosaic, x, y, sources.tile_side, sources.tile_side),
                   std::string(kTileSet) + "/" + std::to_string(tile_number),
                   labelled ? first_class + labels[std::size_t(tile_number)] : -1, sources.held_out, set);
        }
      }
    }
  }
  if (labels.empty() || tile_number == 0) return;
  const int count = 1 + *std::max_element(labels.begin(), labels.end());
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
  return set;
}

std::vector<RgbImage> load_evaluation_images(const fs::path& path) {
  const std::vector<NamedBytes> entries = read_tar_or_folder(path);
  std::vector<RgbImage> images(entries.size());
  on_all_cores(entries.size(),
               [&](std::size_t i) { images[i] = at_evaluation_size(decode_or_throw(path, entries[i])); });
  return images;
}

}  // namespace cnerf
