#include "src/prepare/photographs.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <opencv2/core.hpp>
#include <set>
#include <tuple>
#include <utility>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/parallel.h"
#include "src/base/text.h"
#include "src/capture/image_io.h"
#include "src/capture/listing.h"
#include "src/picture/encode.h"
#include "src/picture/exr_writer.h"
#include "src/prepare/grey_image.h"

namespace cnerf::prepare {
namespace fs = std::filesystem;
namespace {

bool is_heic(const fs::path& file) {
  const std::string extension = lower_extension(file);
  return extension == ".heic" || extension == ".heif" || extension == ".hif" || extension == ".avif";
}

std::vector<fs::path> photographs_in(const fs::path& folder) {
  return files_in(folder, [](const fs::path& file) {
    return !file.filename().string().starts_with('.') && (is_image_file(file) || is_heic(file));
  });
}

void refuse_heic(const fs::path& folder, const std::vector<fs::path>& files) {
  const auto heic = std::ranges::find_if(files, is_heic);
  if (heic == files.end()) return;
  const std::string extension = heic->extension().string();
  throw InputError(
      *heic, "format",
      "expected JPEG, PNG, TIFF or EXR, found HEIC; convert with (Debian package libheif-examples):\n  cd " +
          folder.string() + " && for f in *" + extension + "; do heif-convert -q 95 \"$f\" \"${f%" + extension +
          "}.jpg\" && mv \"$f\" \"$f.done\"; done");
}

/// Stored codes, read as if they were linear, to luminance.
void apply_levels(LinearImage& image, const SensorOptions& sensor, const fs::path& file) {
  if (image.depth == PixelDepth::kF32) return;
  const int largest = image.depth == PixelDepth::kU8 ? 255 : 65535;
  const Levels levels = levels_of(sensor, largest, file);
  const double black = levels.black / largest, white = levels.white / largest;
  const Transfer transfer = transfer_named(sensor.transfer);
  const auto decoded = [&](float code) {
    return decode_transfer(transfer, std::clamp(float((code - black) / (white - black)), 0.0f, 1.0f));
  };
  const auto channels = std::size_t(image.channels);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    const float alpha = image.alpha.empty() ? 1.0f : image.alpha[i / channels];
    image.values[i] = alpha > 0 ? decoded(image.values[i] / alpha) * alpha : 0;
  }
}

/// The luminance image as codes of `T`, with alpha as a colour image where there is some: OpenCV writes no grey +
/// alpha.
template <typename T>
cv::Mat encoded(const LinearImage& image, int type, double largest) {
  cv::Mat out(image.height, image.width, CV_MAKETYPE(type, image.alpha.empty() ? 1 : 4));
  for (std::size_t i = 0; i < image.pixel_count(); ++i) {
    const float alpha = image.alpha.empty() ? 1.0f : image.alpha[i];
    const float straight = alpha > 0 ? image.values[i] / alpha : 0;
    const auto code = T(std::lround(encode_transfer(Transfer::kSrgb, std::clamp(straight, 0.0f, 1.0f)) * largest));
    T* pixel = out.ptr<T>(int(i) / image.width) + (int(i) % image.width) * out.channels();
    pixel[0] = code;
    if (out.channels() == 4) {
      pixel[1] = pixel[2] = code;
      pixel[3] = T(std::lround(alpha * largest));
    }
  }
  return out;
}

/// Codes are kept at 8 bits only where nothing was done to them.
bool stays_eight_bit(const LinearImage& image, const SensorOptions& sensor) {
  return image.depth == PixelDepth::kU8 && sensor.transfer == "srgb" && sensor.black_level == 0 &&
         sensor.white_level == 0;
}

void write_image(const fs::path& file, const LinearImage& image, bool eight_bit) {
  if (image.depth == PixelDepth::kF32) {
    std::vector<ExrChannel> channels = {{"Y", image.values}};
    if (!image.alpha.empty()) channels.push_back({"A", image.alpha});
    write_exr(file, {image.width, image.height, std::move(channels), {}});
  } else {
    write_png(file,
              eight_bit ? encoded<std::uint8_t>(image, CV_8U, 255) : encoded<std::uint16_t>(image, CV_16U, 65535));
  }
}

void write_mask(const fs::path& mask, int orientation, cv::Size stored, const fs::path& target) {
  // Of a photograph on its side the shape tells whether the mask was made of what is stored or of what is shown.
  if (orientation > 4) {
    const ImageHeader found = image_header(mask);
    const bool is_as_stored = same_shape(stored.width, stored.height, found.width, found.height);
    if (!is_as_stored) {
      orientation = 1;
      std::swap(stored.width, stored.height);
    }
  }
  std::vector<std::uint8_t> codes = read_mask(mask, stored.width, stored.height);
  write_png(target, turned_upright(cv::Mat(stored, CV_8U, codes.data()), orientation));
}

/// The stem without white space, which COLMAP's lists cannot hold.
std::string plain_stem(const fs::path& file) {
  std::string stem = file.stem().string();
  std::ranges::replace_if(
      stem, [](unsigned char c) { return std::isspace(c) != 0; }, '_');
  return stem;
}

/// Plain stems; with the extension, then a number, where two photographs would share one.
std::vector<std::string> names_of(const std::vector<fs::path>& files) {
  std::map<std::string, int> uses;
  for (const fs::path& file : files) ++uses[plain_stem(file)];
  std::set<std::string> taken;
  std::vector<std::string> names;
  for (const fs::path& file : files) {
    const std::string stem = plain_stem(file);
    std::string name = uses[stem] == 1 ? stem : stem + "_" + lower_extension(file).substr(1);
    while (!taken.insert(name).second) name += "_" + std::to_string(names.size());
    names.push_back(name);
  }
  return names;
}

struct Imported {
  PreparedImage image;
  std::string lens;  ///< what tells cameras of one size apart
  std::string problem;
};

Imported import_one(const fs::path& file, const std::string& name, const fs::path& capture,
                    const std::map<std::string, fs::path>& masks, const SensorOptions& sensor) {
  Imported out;
  int orientation = 1;
  cv::Size stored_size;
  try {
    if (!is_utf8(name)) throw InputError(printable(file.string()), "name", "expected UTF-8");
    const std::vector<std::byte> content = read_binary_file(file);
    const ExifFacts exif = read_exif(content);
    LinearImage stored = read_linear_image(file, Transfer::kLinear);
    apply_levels(stored, sensor, file);
    const bool eight_bit = stays_eight_bit(stored, sensor);
    stored = luminance_image(std::move(stored));
    orientation = orientation_of(content);
    stored_size = {stored.width, stored.height};
    const LinearImage upright = turned_upright(std::move(stored), orientation);
    PreparedImage& image = out.image;
    image.name = name + (upright.depth == PixelDepth::kF32 ? ".exr" : ".png");
    image.source = file;
    image.width = upright.width;
    image.height = upright.height;
    image.orientation = exif.orientation;
    image.focal = focal_pixels(exif, std::max(image.width, image.height));
    image.sharpness = sharpness(grey_codes(upright));
    out.lens = exif.camera + " " + std::to_string(std::lround(exif.focal_mm * 10)) + " " +
               std::to_string(std::lround(exif.focal_35mm));
    write_image(capture / "images" / image.name, upright, eight_bit);
  } catch (const InputError& failure) {
    out.problem = failure.what();
    return out;
  }
  // A mask that does not fit is a mistake to mend: its photograph is neither left out nor shown unmasked.
  if (const auto mask = masks.find(file.stem().string()); mask != masks.end()) {
    out.image.mask = fs::path("masks") / (name + ".png");
    write_mask(mask->second, orientation, stored_size, capture / out.image.mask);
  }
  return out;
}

/// Numbers cameras: images of one size, taken with one lens, share one.
void group_into_cameras(std::vector<Imported>& imported, PhotographSet& set) {
  std::map<std::tuple<int, int, std::string>, int> cameras;
  for (Imported& each : imported) {
    PreparedImage& image = each.image;
    const auto key = std::tuple(image.width, image.height, each.lens);
    image.camera = cameras.try_emplace(key, int(cameras.size())).first->second;
    set.images.push_back(std::move(image));
  }
  if (cameras.size() > 1) {
    set.notes.push_back("photographs of " + std::to_string(cameras.size()) + " cameras, told apart by size and lens");
  }
}

}  // namespace

Levels levels_of(const SensorOptions& sensor, int largest, const fs::path& source) {
  const Levels out = {sensor.black_level, sensor.white_level > 0 ? sensor.white_level : double(largest)};
  if (out.white > largest) {
    throw UsageError(fmt::format("white_level: expected at most {}, the largest code of {}, found {:g}", largest,
                                 source.string(), out.white));
  }
  if (out.black >= out.white) {
    throw UsageError(fmt::format("black_level: expected less than {:g}, the white of {}, found {:g}", out.white,
                                 source.string(), out.black));
  }
  return out;
}

ImagePlaces::ImagePlaces(const std::vector<PreparedImage>& images) {
  const auto add = [&](const fs::path& name, std::size_t place) {
    by_name_[name.filename().string()] = place;
    by_stem_[name.stem().string()] = place;
  };
  for (std::size_t i = 0; i < images.size(); ++i) add(images[i].source, i);
  for (std::size_t i = 0; i < images.size(); ++i) add(images[i].name, i);
}

std::optional<std::size_t> ImagePlaces::of(const std::string& name) const {
  const fs::path path(name);
  if (const auto found = by_name_.find(path.filename().string()); found != by_name_.end()) return found->second;
  const auto found = by_stem_.find(path.stem().string());
  return found != by_stem_.end() ? std::optional(found->second) : std::nullopt;
}

std::map<std::string, fs::path> masks_in(const fs::path& folder) {
  std::map<std::string, fs::path> masks;
  if (folder.empty()) return masks;
  if (!fs::is_directory(folder)) throw MissingInputError(folder.string() + ": no such folder of masks");
  for (const fs::path& file : photographs_in(folder)) {
    fs::path stem = file.stem();
    if (is_image_file(stem)) stem = stem.stem();
    masks[stem.string()] = file;
  }
  if (masks.empty()) throw MissingInputError(folder.string() + ": holds no mask image");
  return masks;
}

int orientation_of(std::span<const std::byte> file) {
  constexpr std::array<std::uint8_t, 4> kLittleEndian{'I', 'I', 42, 0}, kBigEndian{'M', 'M', 0, 42};
  const auto begins_with = [&](const auto& mark) {
    return file.size() >= 4 && std::memcmp(file.data(), mark.data(), 4) == 0;
  };
  const bool is_tiff = begins_with(kLittleEndian) || begins_with(kBigEndian);
  return is_tiff ? 1 : read_exif(file).orientation;  // OpenCV turns TIFF files upright by itself
}

// EXIF's numbers: from 5 on rows and columns change places; then it is flipped not at all, across, both ways or down.
cv::Mat turned_upright(const cv::Mat& stored, int orientation) {
  const cv::Mat lying = orientation > 4 ? cv::Mat(stored.t()) : stored;
  const int way = (orientation - 1) % 4;
  if (way == 0) return lying;
  cv::Mat upright;  // never in place: `lying` may be the caller's
  cv::flip(lying, upright, way == 1 ? 1 : way == 2 ? -1 : 0);
  return upright;
}

LinearImage turned_upright(LinearImage stored, int orientation) {
  if (orientation == 1) return stored;
  const auto turn = [&](std::vector<float>& values, int channels) {
    const cv::Mat plane(stored.height, stored.width, CV_32FC(channels), values.data());
    const cv::Mat upright = turned_upright(plane, orientation);
    values.assign(upright.ptr<float>(), upright.ptr<float>() + values.size());
  };
  turn(stored.values, stored.channels);
  if (!stored.alpha.empty()) turn(stored.alpha, 1);
  if (orientation > 4) std::swap(stored.width, stored.height);
  return stored;
}

bool holds_photographs(const fs::path& folder) {
  for (const fs::path& place : {folder, folder / "images"}) {
    if (fs::is_directory(place) && !photographs_in(place).empty()) return true;
  }
  return false;
}

std::vector<fs::path> list_photographs(const fs::path& folder) {
  if (!fs::is_directory(folder)) throw MissingInputError(folder.string() + ": no such folder");
  std::vector<fs::path> files = photographs_in(folder);
  if (files.empty() && fs::is_directory(folder / "images")) files = photographs_in(folder / "images");
  if (files.empty()) throw MissingInputError(folder.string() + ": holds no photograph (JPEG, PNG, TIFF or EXR)");
  refuse_heic(files.front().parent_path(), files);
  return files;
}

PhotographSet import_photographs(const std::vector<fs::path>& files, const fs::path& capture, const fs::path& masks,
                                 const SensorOptions& sensor, const ProgressSink& progress) {
  const std::map<std::string, fs::path> mask_of = masks_in(masks);
  const std::vector<std::string> names = names_of(files);
  std::vector<Imported> imported(files.size());
  std::size_t done = 0;
  const std::size_t at_once = std::size_t(std::max(1, thread_count()));
  for (std::size_t begin = 0; begin < files.size(); begin = done) {  // in portions, to report and to stop between them
    done = std::min(files.size(), begin + at_once);
    parallel_tasks(done - begin, [&](std::size_t i) {
      imported[begin + i] = import_one(files[begin + i], names[begin + i], capture, mask_of, sensor);
    });
    if (progress) progress({"photographs", double(done) / double(files.size()), {}});
    if (interruption_requested()) throw Interrupted("stopped while reading photographs");
  }
  PhotographSet set;
  std::erase_if(imported, [&](const Imported& each) {
    if (!each.problem.empty()) set.unreadable.push_back(each.problem);
    return !each.problem.empty();
  });
  group_into_cameras(imported, set);
  if (set.images.size() < 2) {
    throw InputError(files.front().parent_path(), "photographs",
                     "expected at least 2 that can be read, found " + std::to_string(set.images.size()) +
                         (set.unreadable.empty() ? "" : "; the first problem: " + set.unreadable.front()));
  }
  const auto masked = std::ranges::count_if(set.images, [](const PreparedImage& i) { return !i.mask.empty(); });
  if (!masks.empty() && masked == 0) {
    throw InputError(masks, "names", "expected masks named as the photographs, e.g. " + names.front() + ".png");
  }
  return set;
}

}  // namespace cnerf::prepare
