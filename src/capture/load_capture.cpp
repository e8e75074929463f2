#include "src/capture/load_capture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <map>
#include <span>
#include <utility>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/parallel.h"
#include "src/base/text.h"
#include "src/capture/black_background.h"
#include "src/capture/image_io.h"
#include "src/capture/listing.h"
#include "src/capture/pose.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

// ---- recognising a capture ------------------------------------------------------------------------------------------

enum class Format {
  kTransforms,
  kColmap,
  kLlff,
  kMetashape,
  kRealityCaptureTable,
  kRealityCaptureSidecars,
  kPolycam,
  kRecord3d
};
struct Source {
  Format format;
  fs::path root;  ///< the capture folder
  fs::path path;  ///< marker file, or folder of a model, of cameras or of sidecars
};

bool is_colmap_model(const fs::path& folder) {
  return fs::exists(folder / "cameras.bin") || fs::exists(folder / "cameras.txt");
}

/// All models in the places COLMAP and its users put them.
std::vector<fs::path> find_colmap_models(const fs::path& root) {
  std::vector<fs::path> models;
  for (const fs::path& place : {root, root / "sparse", root / "colmap" / "sparse"}) {
    if (is_colmap_model(place)) models.push_back(place);
    if (place == root || !fs::is_directory(place)) continue;
    for (const auto& entry : fs::directory_iterator(place)) {
      if (entry.is_directory() && is_colmap_model(entry.path())) models.push_back(entry.path());
    }
  }
  std::sort(models.begin(), models.end());
  return models;
}

fs::path largest_model(const std::vector<fs::path>& models) {
  const auto images = [](const fs::path& model) -> std::size_t {
    try {
      return colmap_image_count(model);
    } catch (const Error&) {
      return 0;  // an incomplete one
    }
  };
  return *std::ranges::max_element(models, {}, images);
}

/// All there are, the preferred one first: a capture may carry poses in several conventions.
std::vector<Source> sources_in_folder(const fs::path& root) {
  std::vector<Source> sources;
  for (const char* marker : {"transforms.json", "transforms_train.json"}) {
    if (sources.empty() && fs::exists(root / marker)) sources.push_back({Format::kTransforms, root, root / marker});
  }
  if (const std::vector<fs::path> models = find_colmap_models(root); !models.empty()) {
    sources.push_back({Format::kColmap, root, largest_model(models)});
  }
  if (fs::exists(root / "poses_bounds.npy")) sources.push_back({Format::kLlff, root, root / "poses_bounds.npy"});
  if (fs::exists(root / "cameras.xml")) sources.push_back({Format::kMetashape, root, root / "cameras.xml"});
  const auto add = [&](Format format, const std::optional<fs::path>& found) {
    if (found) sources.push_back({format, root, *found});
  };
  add(Format::kRealityCaptureTable, find_realitycapture_table(root));
  add(Format::kRealityCaptureSidecars, find_realitycapture_sidecars(root));
  add(Format::kPolycam, find_polycam_cameras(root));
  add(Format::kRecord3d, find_record3d_metadata(root));
  return sources;
}

/// What is in the folder of a capture and might have been meant as its poses.
std::string stands_there(const fs::path& root) {
  if (fs::is_empty(root)) return ": the folder is empty; ";
  std::vector<fs::path> files = files_with_extension(root, ".csv");
  if (files.empty()) files = files_with_extension(root, ".xmp");
  if (files.empty()) files = files_with_extension(root / "images", ".xmp");
  const std::string last = files.empty() ? "" : ", nor does " + files[0].filename().string() + " state any";
  return ": no poses found" + last + "; ";
}

[[noreturn]] void refuse_without_poses(const fs::path& root) {
  throw MissingInputError(
      root.string() + stands_there(root) +
      "looked for transforms.json, transforms_train.json, a COLMAP model (cameras.bin or cameras.txt "
      "here, in sparse/, sparse/*/ or colmap/sparse/*/), poses_bounds.npy, Metashape's cameras.xml, RealityCapture's "
      "table (*.csv that begins with #name) or sidecars (*.xmp here or in images/), Polycam's keyframes/ and "
      "Record3D's metadata.json beside rgb/; cnerf prepare makes a capture of photographs or a film clip");
}

std::vector<Source> recognise(const fs::path& path) {
  std::error_code failure;  // a name too long for the file system is of nothing
  if (!fs::exists(path, failure)) throw MissingInputError(path.string() + ": no such file or folder");
  if (fs::is_directory(path)) {
    std::vector<Source> sources = sources_in_folder(path);
    if (sources.empty()) refuse_without_poses(path);
    return sources;
  }
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  if (path.filename() == "metadata.json") return {{Format::kRecord3d, folder, path}};
  if (path.extension() == ".json") return {{Format::kTransforms, folder, path}};
  if (path.extension() == ".npy") return {{Format::kLlff, folder, path}};
  if (lower_extension(path) == ".xml") return {{Format::kMetashape, folder, path}};
  if (lower_extension(path) == ".csv") return {{Format::kRealityCaptureTable, folder, path}};
  if (is_colmap_model(folder)) return {{Format::kColmap, folder, folder}};
  throw InputError(
      path, "",
      "expected a folder, a transforms.json, a file of a COLMAP model, a poses_bounds.npy, Metashape's .xml, "
      "RealityCapture's .csv or Record3D's metadata.json");
}

/// Takes copies in images_N folders where there are some, and leaves the rest to be resized.
void apply_downscale(CaptureListing& listing, int downscale) {
  if (downscale == 1) return;
  for (ListedView& view : listing.views) {
    const std::optional<fs::path> copy = reduced_copy(view.image_file, downscale);
    if (copy) view.full_file = std::exchange(view.image_file, *copy);
    view.downscale = copy ? 1.0 : double(downscale);
  }
}

CaptureListing read_listing(const Source& source, int downscale) {
  const auto read = [&] {
    switch (source.format) {
      case Format::kTransforms:
        return read_transforms(source.path);
      case Format::kColmap:
        return read_colmap(source.root, source.path);
      case Format::kLlff:
        return read_llff(source.path, downscale);
      case Format::kMetashape:
        return read_metashape(source.path);
      case Format::kRealityCaptureTable:
        return read_realitycapture_table(source.path);
      case Format::kRealityCaptureSidecars:
        return read_realitycapture_sidecars(source.path);
      case Format::kPolycam:
        return read_polycam(source.path);
      case Format::kRecord3d:
        return read_record3d(source.path);
    }
    throw ContractError("a format without a reader");
  };
  CaptureListing listing = read();
  bring_near_origin(listing);
  if (source.format == Format::kPolycam || source.format == Format::kRecord3d) {
    listing.notes.emplace_back("Y is up in these poses: bake with --set vdb.up_axis=y");
  }
  if (source.format != Format::kLlff) apply_downscale(listing, downscale);  // which has chosen by itself
  return listing;
}

// Which views there are.

/// Drops views whose image does not exist, and says so.
void drop_missing_images(CaptureListing& listing) {
  std::string first;
  const std::size_t missing = std::erase_if(listing.views, [&](const ListedView& view) {
    std::error_code failure;  // a name too long for the file system is of no file
    if (fs::is_regular_file(view.image_file, failure)) return false;
    if (first.empty()) first = view.name;
    return true;
  });
  if (missing == 0) return;
  listing.notes.push_back(std::to_string(missing) + " of " + std::to_string(listing.listed_images) +
                          " listed images do not exist and were skipped, the first: " + first);
}

/// Names that cameras share, as those of two flights do, find one file for both.
void refuse_one_image_of_two_views(const CaptureListing& listing) {
  std::map<fs::path, const ListedView*> of_image;
  for (const ListedView& view : listing.views) {
    const auto [other, is_first] = of_image.try_emplace(view.image_file, &view);
    if (is_first) continue;
    throw InputError(view.poses_file, printable(view.field),
                     fmt::format("is of the same image as {}, {}; give them different names", other->second->field,
                                 view.image_file.string()));
  }
}

void refuse_too_few(const CaptureListing& listing) {
  if (listing.views.size() >= 2) return;
  throw InputError(listing.source, "views",
                   "expected at least 2 usable images, found " + std::to_string(listing.views.size()) + " (of " +
                       std::to_string(listing.listed_images) + " listed)");
}

void choose_held_out(std::vector<ListedView>& views, int holdout) {
  if (holdout > 0) {
    for (std::size_t i = 0; i < views.size(); ++i) views[i].held_out = i % std::size_t(holdout) == 0;
  }
  const auto training = std::count_if(views.begin(), views.end(), [](const ListedView& v) { return !v.held_out; });
  if (training >= 2) return;
  const fs::path& file = views.front().poses_file;
  const std::string left =
      fmt::format("leaves {} of {} views for training; at least 2 are needed", training, views.size());
  if (holdout > 0) throw UsageError(fmt::format("capture.holdout: {} {} ({})", holdout, left, file.string()));
  throw InputError(file, "split", left);
}

/// The first source with at least two usable views, and a note where that is not the preferred one.
/// @throws InputError, MissingInputError  what is wrong with the preferred one, where none is whole.
CaptureListing first_whole(const std::vector<Source>& sources, int downscale) {
  std::exception_ptr first_problem;
  std::string aside;
  for (const Source& source : sources) {
    try {
      CaptureListing listing = read_listing(source, downscale);
      listing.listed_images = listing.views.size();
      for (const ListedView& view : listing.views) {
        if (!is_utf8(view.name)) {
          throw InputError(view.poses_file, printable(view.field), "expected an image name in UTF-8");
        }
      }
      drop_missing_images(listing);
      if (source.format != Format::kTransforms) refuse_one_image_of_two_views(listing);
      refuse_too_few(listing);
      if (!aside.empty()) listing.notes.push_back("poses: " + listing.source.string() + " is taken" + aside);
      return listing;
    } catch (const Error& problem) {
      if (!first_problem) first_problem = std::current_exception();
      aside += "; left aside as incomplete: " + std::string(problem.what());
    }
  }
  std::rethrow_exception(first_problem);
}

// Images and intrinsics.

void check_plausible(const ListedView& view, const Intrinsics& lens) {
  const auto found = implausible_number(lens, view.world_from_camera.translation);
  if (found) {
    const fs::path& file = found->field == "position" ? view.poses_file : view.file_of_lens();
    throw InputError(file, view.field + "." + found->field, found->problem);
  }
  if (view.exposure >= 1e-4 && view.exposure <= 1e4) return;
  throw InputError(view.poses_file, view.field + ".exposure",
                   fmt::format("expected a number from 0.0001 to 10000, found {:g}", view.exposure));
}

/// Intrinsics for the image as stored: what the file leaves out follows from the size, and the numbers are checked.
Intrinsics complete_intrinsics(const ListedView& view, int width, int height) {
  Intrinsics out = view.intrinsics;
  if (out.width == 0) {  // its numbers are of the full size
    std::error_code failure;
    const bool is_copy = !view.full_file.empty() && fs::is_regular_file(view.full_file, failure);
    const ImageHeader full = is_copy ? image_header(view.full_file) : ImageHeader{width, height};
    out.width = full.width;
    out.height = full.height;
  }
  if (!same_shape(width, height, out.width, out.height)) {
    throw InputError(view.image_file, "size",
                     "expected " + size_text(out.width, out.height) + " as " + view.file_of_lens().filename().string() +
                         " says, or the same shape, found " + size_text(width, height));
  }
  if (out.fx == 0 && view.angle_x != 0) out.fx = 0.5 * out.width / std::tan(0.5 * view.angle_x);
  if (out.fy == 0) out.fy = view.angle_y != 0 ? 0.5 * out.height / std::tan(0.5 * view.angle_y) : out.fx;
  if (out.fx == 0) out.fx = out.fy;
  if (out.cx == kCentred) out.cx = 0.5 * out.width;
  if (out.cy == kCentred) out.cy = 0.5 * out.height;
  check_plausible(view, out);
  return resized(out, width, height);
}

int reduced(int size, double downscale) {
  return std::max(1, int(std::lround(size / downscale)));
}

/// A view without its pixels.  @param header  of its file
View surveyed_view(const ListedView& listed, const ImageHeader& header) {
  View out;
  out.name = listed.name;
  out.image_file = listed.image_file;
  out.world_from_camera = listed.world_from_camera;
  out.held_out = listed.held_out;
  out.intrinsics = complete_intrinsics(listed, header.width, header.height);
  out.image.width = reduced(header.width, listed.downscale);
  out.image.height = reduced(header.height, listed.downscale);
  out.intrinsics = resized(out.intrinsics, out.image.width, out.image.height);
  out.image.depth = header.depth;
  return out;
}

struct LoadedView {
  View view;
  bool had_color = false;
};

LoadedView load_view(const ListedView& listed, Transfer transfer) {
  // A picture of another shape is refused before it is decoded.
  if (const auto header = stated_header(listed.image_file)) (void)surveyed_view(listed, *header);
  LinearImage image = read_linear_image(listed.image_file, transfer);
  LoadedView out = {surveyed_view(listed, image_header(image)), !is_monochrome(image)};
  const int width = out.view.image.width, height = out.view.image.height;
  image = luminance_image(std::move(image));
  if (listed.downscale > 1) image = area_resized(image, width, height);
  out.view.image = encode_mono(image, transfer);
  out.view.image.exposure = float(listed.exposure);
  out.view.image.haze = float(listed.haze);
  if (!listed.mask_file.empty()) out.view.image.mask = read_mask(listed.mask_file, width, height);
  return out;
}

/// The share of pixels that show nothing from which a view counts as a cut-out object.
constexpr double kTransparentShare = 0.05;

bool is_cut_out(const View& view) {
  const PixelPlane<std::uint8_t>& alpha = view.image.alpha;
  const auto transparent = std::count(alpha.begin(), alpha.end(), std::uint8_t(0));
  return double(transparent) > kTransparentShare * double(view.image.pixel_count());
}

/// Where nothing is cut out, what is transparent was not seen (the border of an undistorted picture): to be ignored,
/// not learnt as empty space.
void mask_what_is_transparent(MonoImage& image) {
  if (image.alpha.empty()) return;
  const PixelPlane<std::uint8_t>& alpha = image.alpha;
  image.mask.bring_to_memory();
  if (image.mask.empty()) image.mask.assign(image.pixel_count(), 255);
  for (std::size_t i = 0; i < image.pixel_count(); ++i) {
    if (alpha[i] < 255) image.mask[i] = 0;
  }
  image.alpha.clear();
}

/// Where all pixels are masked, training would learn from masked ones.
void refuse_without_pixels(const Capture& capture) {
  const auto shows_something = [](const View& view) {
    if (view.held_out) return false;
    const PixelPlane<std::uint8_t>& mask = view.image.mask;
    return mask.empty() || std::any_of(mask.begin(), mask.end(), [](int code) { return code != 0; });
  };
  if (std::ranges::any_of(capture.views, shows_something)) return;
  throw InputError(capture.root, "masks",
                   "expected some pixels of the views to train on, found all masked or transparent");
}

/// See `Capture::cameras`. Numbers count in millionths, of the cameras' reach or of a picture's side, so that neither a
/// downscale nor another processor rounds them differently. Round numbers are common, so borders lie beside them.
std::string digest_of_cameras(const std::vector<View>& views) {
  double reach = 0;
  for (const View& view : views) {
    const Vec3d at = view.world_from_camera.translation;
    if (!view.held_out) reach = std::max({reach, std::abs(at.x), std::abs(at.y), std::abs(at.z)});
  }
  int exponent = 0;
  (void)std::frexp(1.37 * reach, &exponent);
  std::string text = fmt::format("{}\n", exponent);
  const auto add = [&](double number) { text += fmt::format("{} ", std::floor(std::ldexp(number, 20) + 0.38)); };
  for (const View& view : views) {
    if (view.held_out) continue;
    for (int axis = 0; axis < 3; ++axis) {
      for (int column = 0; column < 3; ++column) add(view.world_from_camera.linear.rows[axis][column]);
      add(std::ldexp(view.world_from_camera.translation[axis], -exponent));
    }
    const Intrinsics& lens = view.intrinsics;
    const double width = lens.width, height = lens.height;
    text += fmt::format("{} ", int(lens.model));
    for (const double number : {lens.fx / width, lens.fy / height, lens.cx / width, lens.cy / height}) add(number);
    for (const double coefficient : lens.distortion) add(coefficient);
  }
  return sha256(std::as_bytes(std::span(text)));
}

/// What the pixels of all views will take, by the headers that say it.
std::size_t stated_bytes(const std::vector<ListedView>& listed) {
  double bytes = 0;
  for (const ListedView& view : listed) {
    std::optional<ImageHeader> header;
    try {
      header = stated_header(view.image_file);
    } catch (const Error&) {
      continue;  // who reads it says what is wrong
    }
    if (!header) continue;
    const int depth = header->depth == PixelDepth::kU8 ? 1 : header->depth == PixelDepth::kU16 ? 2 : 4;
    const int of_pixel = depth + (header->has_alpha ? 1 : 0);
    bytes += of_pixel * double(header->width) * double(header->height) / (view.downscale * view.downscale);
  }
  return std::size_t(bytes);
}

void load_views(const std::vector<ListedView>& listed, Transfer transfer, PhotographStore& store, Capture& capture) {
  std::vector<LoadedView> loaded(listed.size());
  parallel_tasks(listed.size(), [&](std::size_t i) {
    loaded[i] = load_view(listed[i], transfer);
    store.take(loaded[i].view.image);
  });
  const auto colored = std::count_if(loaded.begin(), loaded.end(), [](const LoadedView& v) { return v.had_color; });
  if (colored > 0) {
    capture.notes.push_back(std::to_string(colored) + " of " + std::to_string(loaded.size()) +
                            " images have colours; only their luminance is used");
  }
  for (LoadedView& view : loaded) capture.views.push_back(std::move(view.view));
}

/// A listing with its views in order, some of them held out.
struct Found {
  fs::path root;
  CaptureListing listing;
};

Found find_views(const fs::path& path, const CaptureOptions& options) {
  if (options.downscale < 1)
    throw UsageError("downscale: expected at least 1, found " + std::to_string(options.downscale));
  const std::vector<Source> sources = recognise(path);
  Found found = {sources.front().root, first_whole(sources, options.downscale)};
  std::ranges::stable_sort(found.listing.views, {}, &ListedView::name);
  choose_held_out(found.listing.views, options.holdout);
  return found;
}

/// All but the views.
Capture capture_without_views(const Found& found) {
  Capture capture;
  capture.root = found.root;
  capture.format = found.listing.format;
  capture.points = points_by_place(found.listing);
  capture.depth_range = found.listing.depth_range;
  capture.bounds = found.listing.bounds;
  capture.listed_images = int(found.listing.listed_images);
  capture.notes = found.listing.notes;
  return capture;
}

}  // namespace

bool holds_poses(const fs::path& folder) {
  return !sources_in_folder(folder).empty();
}

Capture survey_capture(const fs::path& path, const CaptureOptions& options) {
  Found found = find_views(path, options);
  Capture capture = capture_without_views(found);
  const std::vector<ListedView>& listed = found.listing.views;
  capture.views.resize(listed.size());
  parallel_tasks(listed.size(), [&](std::size_t i) {
    capture.views[i] = surveyed_view(listed[i], image_header(listed[i].image_file));
  });
  return capture;
}

std::vector<FullSizeImage> full_size_images(const fs::path& path, const CaptureOptions& options) {
  std::vector<FullSizeImage> images;
  std::error_code failure;
  for (const ListedView& view : find_views(path, options).listing.views) {
    const bool is_copy = !view.full_file.empty() && fs::is_regular_file(view.full_file, failure);
    images.push_back({view.name, is_copy ? view.full_file : view.image_file});
  }
  return images;
}

Capture load_capture(const fs::path& path, const CaptureOptions& options, const ImageMemory& memory) {
  const Transfer transfer = transfer_named(options.transfer);
  Found found = find_views(path, options);
  Capture capture = capture_without_views(found);
  const std::vector<ListedView>& listed = found.listing.views;
  PhotographStore store(memory, stated_bytes(listed));
  load_views(listed, transfer, store, capture);
  const auto put = [&](MonoImage& image) {
    if (store.has_file()) store.put(image);
  };
  for (View& view : capture.views) put(view.image);  // those that came before there was a file
  if (options.cut_out_of_black && !capture.depth_range && cut_out_of_black(capture.views, put)) {
    capture.notes.push_back(
        "all views show an object before black, which is taken as empty (capture.cut_out_of_black)");
  }
  capture.is_bounded_object = std::all_of(capture.views.begin(), capture.views.end(), is_cut_out);
  if (!capture.is_bounded_object) {
    for (View& view : capture.views) {
      mask_what_is_transparent(view.image);
      put(view.image);
    }
  }
  refuse_without_pixels(capture);
  capture.cameras = digest_of_cameras(capture.views);
  return capture;
}

}  // namespace cnerf
