#include "src/pipeline/photographs_step.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/statistics.h"
#include "src/base/usage.h"
#include "src/capture/image_io.h"
#include "src/capture/load_capture.h"
#include "src/capture/picture_names.h"
#include "src/cluster/share_out.h"
#include "src/color/colorspace_math.h"
#include "src/picture/colored_photograph.h"
#include "src/picture/encode.h"
#include "src/pipeline/known_color_files.h"
#include "src/pipeline/render_step.h"
#include "src/prepare/photographs.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;
namespace {

/// Of the picture in which a take's chroma is rendered, whatever the photograph's size: 566 x 424. Twice as many make
/// it no better, as chroma changes slowly and its edges come from the photograph.
constexpr double kRenderedPixels = 240'000;

struct Photograph {
  const View* view = nullptr;
  fs::path file;     ///< to read
  std::string name;  ///< of the file to write, without extension
};

/// Names of files to write: those of the photographs; where two share one, those of the views.
std::vector<std::string> names_of(const std::vector<FullSizeImage>& images) {
  std::set<std::string> stems;
  for (const FullSizeImage& image : images) stems.insert(image.file.stem().string());
  const bool are_shared = stems.size() < images.size();
  std::vector<std::string> names;
  PictureNames free_names;
  for (const FullSizeImage& image : images) {
    names.push_back(free_names.name_for(are_shared ? image.view : image.file.filename().string()));
  }
  return names;
}

/// All photographs of the context's capture.
std::vector<Photograph> all_photographs(const RunContext& context, const fs::path& capture) {
  const std::vector<View>& views = context.capture.views;
  const std::vector<FullSizeImage> images = full_size_images(capture, context.config.capture);
  const auto is_of = [](const View& view, const FullSizeImage& image) { return view.name == image.view; };
  if (!std::ranges::equal(views, images, is_of)) {
    throw InputError(capture, "views", "other ones than when the capture was read");
  }
  const std::vector<std::string> names = names_of(images);
  std::vector<Photograph> photographs;
  for (std::size_t i = 0; i < views.size(); ++i) photographs.push_back({&views[i], images[i].file, names[i]});
  return photographs;
}

/// Those of some views.
/// @param all  of the capture
std::vector<Photograph> chosen(const std::vector<Photograph>& all, const Capture& capture,
                               const std::vector<std::string>& views) {
  if (views.empty()) return all;
  std::vector<std::string> file_names;
  for (const Photograph& photograph : all) file_names.push_back(photograph.name);
  std::set<std::size_t> places;
  for (const std::string& name : views) places.insert(view_called(capture, name, "photographs", file_names));
  std::vector<Photograph> some;
  for (const std::size_t place : places) some.push_back(all[place]);
  return some;
}

/// The grey of a file, as the capture's reader sees it.
LinearImage read_grey(const Photograph& photograph, Transfer transfer) {
  LinearImage grey = luminance_image(read_linear_image(photograph.file, transfer));
  const Intrinsics& lens = photograph.view->intrinsics;
  if (!same_shape(lens.width, lens.height, grey.width, grey.height)) {
    throw InputError(photograph.file, "size",
                     "expected the shape of " + size_text(lens.width, lens.height) + ", found " +
                         size_text(grey.width, grey.height));
  }
  return grey;
}

/// The camera of a view at the size in which chroma is rendered.
Intrinsics rendered_lens(const View& view, int width, int height) {
  const double scale = std::min(1.0, std::sqrt(kRenderedPixels / (double(width) * height)));
  const auto side = [&](int full) { return std::max(1, int(std::lround(full * scale))); };
  return resized(view.intrinsics, side(width), side(height));
}

/// Chroma of a rendered view for a photograph of its size.
/// @param grey  the photograph, over black
ChromaSamples chroma_of(const RenderedImage& rendered, const LinearImage& grey) {
  GainFit exposure;  // of the photograph: the scene is learned at one for all
  for (std::size_t i = 0; i < grey.values.size(); ++i) exposure.add(rendered.luminance[i], grey.values[i]);
  const float gain = exposure.gain() > 0 ? float(exposure.gain()) : 1.0f;
  ChromaSamples samples{grey.width, grey.height, {}, {}, {}};
  for (std::size_t i = 0; i < grey.values.size(); ++i) {
    const float opacity = rendered.opacity[i];
    const float* rgb = &rendered.rgb[3 * i];
    samples.ab.push_back(ab_of_linear_rgb({rgb[0], rgb[1], rgb[2]}));
    samples.lightness.push_back(opacity > 0 ? lightness_from_luminance(gain * rendered.luminance[i] / opacity) : 0.0f);
    samples.weight.push_back(opacity * (grey.alpha.empty() ? 1.0f : grey.alpha[i]));
  }
  return samples;
}

/// The photograph without the black that it was put over. Where it covers nothing, it is black.
GreyPhotograph uncovered(LinearImage grey) {
  for (std::size_t i = 0; i < grey.alpha.size(); ++i) {
    if (grey.alpha[i] > 0) grey.values[i] /= grey.alpha[i];
  }
  return {grey.width, grey.height, std::move(grey.values), std::move(grey.alpha)};
}

/// The photograph in colour, turned as its file says that it is to be shown: what is written has no such note.
cv::Mat colored(const Photograph& photograph, const Scene& scene, const Config& config) {
  LinearImage grey = read_grey(photograph, transfer_named(config.capture.transfer));
  const View& view = *photograph.view;
  const Intrinsics lens = rendered_lens(view, grey.width, grey.height);
  const RenderedImage rendered = scene.render(lens, view.world_from_camera, render_options(config));
  const ChromaSamples chroma = chroma_of(rendered, area_resized(grey, lens.width, lens.height));
  return prepare::turned_upright(colored_photograph(uncovered(std::move(grey)), chroma),
                                 prepare::orientation_of(read_binary_file(photograph.file)));
}

}  // namespace

PhotographFormat photograph_format_named(const std::string& name) {
  if (name == "png") return PhotographFormat::kPng;
  if (name == "tiff") return PhotographFormat::kTiff;
  throw UsageError("--format: expected png or tiff for photographs, got '" + name + "'");
}

fs::path photographs_folder(const RunDirectory& directory, const std::string& take) {
  return directory.renders(take) / "photographs";
}

void check_photographs_take(const RunDirectory& directory, const std::string& take) {
  if (!take.empty()) return;
  throw UsageError(directory.root().string() +
                   ": has no take yet, and photographs get their colours from one; make it with: cnerf colorize " +
                   directory.root().string());
}

std::vector<fs::path> photographs_step(const RunContext& context, const PhotographsJob& job, const Engines& engines,
                                       Observer& observer) {
  const RunDirectory& directory = context.directory;
  check_photographs_take(directory, job.take);
  const fs::path capture = job.capture.empty() ? directory.record().capture : job.capture;
  const std::vector<Photograph> photographs = chosen(all_photographs(context, capture), context.capture, job.views);
  const StepLocks locks(directory, job.folder, observer);
  const Stopwatch watch;
  Finish finish = context.config.finish;
  finish.exposure = 0;  // their own light stays
  const auto scene = load_scene(directory, job.take, finish, engines);
  const ProgressSink progress = observer.progress_sink();
  const bool is_tiff = job.format == PhotographFormat::kTiff;
  std::vector<fs::path> files;
  for (const Photograph& one : photographs) files.push_back(job.folder / (one.name + (is_tiff ? ".tiff" : ".png")));
  std::size_t written = 0;
  const auto write = [&](std::size_t i) {
    if (observer.is_cancelled()) {
      throw Interrupted(fmt::format("stopped; {} of {} photographs were written", written, photographs.size()));
    }
    const cv::Mat picture = colored(photographs[i], *scene, context.config);
    (is_tiff ? write_tiff : write_srgb_png)(files[i], picture);
  };
  const auto done = [&](std::size_t i) {
    written = i + 1;
    progress({"photographs", double(written) / double(photographs.size()), {}});
  };
  cluster::share_out(cluster::world(), photographs.size(), write, done);
  if (!cluster::world().is_first()) return files;
  observer.wrote("photographs", job.folder);
  note_time(directory, "photographs", watch);
  return files;
}

}  // namespace cnerf::pipeline
