#include "src/pipeline/prepare_step.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "src/base/absolute_folder.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/json.h"
#include "src/capture/load_capture.h"
#include "src/picture/encode.h"
#include "src/pipeline/run_context.h"
#include "src/prepare/capture_writer.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;
namespace {

/// The mark of a folder that preparing began, so that nothing else is ever cleared.
constexpr const char* kMark = "work/source.txt";
/// What says the same once the capture is finished: work/ may be deleted then.
constexpr const char* kRecord = "prepare.json";
/// What preparing makes, and clears to make it again: first what says that it is finished, last what says whose it is.
constexpr std::array kMade = {
    "transforms.json", prepare::kPointsFile, "contact_sheet.png", "images", "masks", kRecord, "work"};

/// What moved in a view, together with what was masked already, at the size of the view.
cv::Mat1b still_part(const prepare::MotionMask& mask, const MonoImage& image) {
  std::vector<std::uint8_t> codes = mask.valid;
  cv::Mat1b still;
  cv::resize(cv::Mat1b(mask.height, mask.width, codes.data()), still, {image.width, image.height}, 0, 0,
             cv::INTER_NEAREST);
  for (std::size_t p = 0; p < image.pixel_count(); ++p) {
    if (!image.valid(p)) still(int(p) / still.cols, int(p) % still.cols) = 0;
  }
  return still;
}

/// Masks what moves, in files of the pictures' own size beside those that are there, and names them in transforms.json.
void mask_motion(const fs::path& capture, const prepare::MotionMaskOptions& options, const Engines& engines,
                 Observer& observer) {
  CaptureOptions reading;
  const Capture full = load_capture(capture, reading);
  int longest = 0;
  for (const View& view : full.views) longest = std::max({longest, view.image.width, view.image.height});
  reading.downscale = std::max(1, longest / options.motion_side);
  const auto masks = prepare::find_motion(load_capture(capture, reading), options, capture / "work", engines, observer);

  auto transforms = read_json(capture / "transforms.json");
  auto record = read_json(capture / kRecord);
  double share = 0;
  std::string left_alone;
  for (std::size_t v = 0; v < masks.size(); ++v) {
    const View& view = full.views[v];
    const prepare::MotionMask& mask = masks[v];
    if (mask.valid.empty()) left_alone += (left_alone.empty() ? "" : ", ") + view.name;
    if (mask.valid.empty() || mask.share == 0) continue;
    share += mask.share / double(masks.size());
    const fs::path file = fs::path("masks") / ("still_" + fs::path(view.name).stem().string() + ".png");
    write_png(capture / file, still_part(mask, view.image));
    for (auto& frame : transforms.at("frames")) {
      if (frame.at("file_path") == view.name) frame["mask_path"] = file.generic_string();
    }
    record["motion"]["shares"][view.name] = mask.share;
  }
  record["motion"]["difference"] = options.motion_difference;
  record["motion"]["steps"] = options.motion_steps;
  write_file(capture / "transforms.json", transforms.dump(1) + "\n");
  write_file(capture / kRecord, record.dump(1) + "\n");  // last: it says that all of this was done
  observer.say(fmt::format("motion: {:.1f} % of the pictures is masked (masks/still_*.png)", 100 * share));
  if (!left_alone.empty()) observer.say("motion: fitted too badly to tell, not masked: " + left_alone);
}

std::string origin_of(const PrepareJob& job) {
  return fs::absolute(job.source).lexically_normal().string() + "\n";
}

/// What a folder was begun of, as `origin_of` says it; nothing where preparing did not begin it.
std::optional<std::string> origin_in(const fs::path& out) {
  if (fs::exists(out / kMark)) return read_text_file(out / kMark);
  if (!fs::exists(out / kRecord)) return {};
  const auto record = read_json(out / kRecord);
  const auto source = record.find("source");
  if (source == record.end() || !source->is_string()) return {};
  return source->get<std::string>() + "\n";
}

bool is_within(const fs::path& path, const fs::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), path.begin(), path.end()).first == folder.end();
}

/// Clears a folder to make its capture again.  @throws UsageError  where that would remove what it is made of
void clear_capture(const PrepareJob& job) {
  const auto place_of = [](const fs::path& path) { return fs::weakly_canonical(fs::absolute(path)); };
  const prepare::PrepareOptions& options = job.options.capture;
  for (const fs::path& input :
       {job.source, job.source / "images", fs::path(options.masks), fs::path(options.colmap_model)}) {
    for (const char* made : kMade) {
      if (input.empty() || !is_within(place_of(input), place_of(job.out / made))) continue;
      throw UsageError(input.string() + ": --overwrite would remove it, with " + (job.out / made).string() +
                       "; choose another folder for the capture");
    }
  }
  for (const char* made : kMade) remove_output(job.out / made);
}

/// Whether a folder may take the capture; clears what is to be made again.
/// @return  false where the capture is finished and stays
bool begin_folder(const PrepareJob& job) {
  const auto& [source, out, options, existing] = job;
  check_choice(existing);
  const bool finished = fs::exists(out / "transforms.json");
  const std::optional<std::string> begun = origin_in(out);
  const bool ours = begun.has_value();
  if (existing.resume && was_begun_for_another(job)) {
    throw UsageError(out.string() + ": was begun for another source, " + *begun +
                     "pass --overwrite, or choose another folder");
  }
  if (finished && ours && existing.resume) return false;
  const fs::path work = fs::path(kMark).parent_path();
  if (ours || !is_vacant(out, {work}) || !is_vacant(out / work)) {
    if (!ours) throw UsageError(out.string() + ": is not empty and holds no prepared capture; choose another folder");
    if (!existing.resume && !existing.overwrite) {
      throw UsageError(out.string() +
                       (finished ? ": holds a capture already; pass --overwrite to make it again"
                                 : ": was begun already; pass --resume to go on or --overwrite to start again"));
    }
    if (existing.overwrite) clear_capture(job);
  }
  write_file(out / kMark, origin_of(job));
  return true;
}

/// A finished capture stays as it is, so its source has to have been read as is asked now.
/// @throws UsageError
void check_transfer(const PrepareJob& job, const nlohmann::ordered_json& record) {
  const std::string& asked = job.options.capture.sensor.transfer;
  const nlohmann::ordered_json::json_pointer place("/transfer/source");
  if (asked == "srgb" || (record.contains(place) && record.at(place) == asked)) return;
  throw UsageError(job.out.string() + ": was prepared with another transfer; cnerf prepare " + job.source.string() +
                   " -o " + job.out.string() + " --transfer " + asked + " --overwrite makes it again");
}

/// Whether files came, went or were written in a source after its capture was finished.
bool has_changed_since(const fs::path& source, const fs::path& capture) {
  std::error_code failure;  // what cannot be read is not newer
  const fs::file_time_type finished = fs::last_write_time(capture / "transforms.json", failure);
  return std::ranges::any_of(std::array{source, source / "images"}, [&](const fs::path& place) {
    if (fs::last_write_time(place, failure) > finished) return true;  // of a folder: its list
    const fs::directory_iterator files(place, failure);
    return std::any_of(begin(files), end(files), [&](const auto& file) {
      return file.is_regular_file(failure) && file.last_write_time(failure) > finished;
    });
  });
}

}  // namespace

bool was_begun_for_another(const PrepareJob& job) {
  const std::optional<std::string> begun = origin_in(job.out);
  return begun && *begun != origin_of(job);
}

void prepare_step(const PrepareJob& job, const Engines& engines, Observer& observer) {
  const PrepareStepOptions& options = job.options;
  prepare::check_options(options.capture);
  if (!fs::exists(job.source)) throw MissingInputError(job.source.string() + ": no such file or folder");
  const FolderLock lock = lock_folder(job.out, FolderLock::Mode::kAlone, observer);
  if (!begin_folder(job)) {
    const auto record = read_json(job.out / kRecord);
    check_transfer(job, record);
    observer.say("capture: " + job.out.string() + " was prepared before");
    if (has_changed_since(job.source, job.out)) {
      observer.say("note: " + job.source.string() + " has changed since; cnerf prepare " + job.source.string() +
                   " -o " + job.out.string() + " --overwrite takes what is there now");
    }
    if (options.motion_masks && !record.contains("motion")) mask_motion(job.out, options.motion, engines, observer);
    return;
  }
  prepare_capture(job.source, job.out, options.capture, observer.progress_sink(),
                  [&](const std::string& text) { observer.say(text); });
  if (options.motion_masks) mask_motion(job.out, options.motion, engines, observer);
  observer.wrote("contact sheet", job.out / "contact_sheet.png");
  observer.wrote("capture", job.out);
}

fs::path capture_of(const fs::path& source, const fs::path& run, const std::string& transfer, Observer& observer) {
  if (!prepare::needs_preparing(source)) return source;
  const fs::path folder = absolute_folder(run);
  const fs::path capture = folder.parent_path() / (folder.filename().string() + "-capture");
  observer.say("no camera poses in " + source.string() + ": preparing a capture (cnerf prepare has options for this)");
  PrepareJob job{source, capture, {}, {.resume = true}};
  job.options.capture.sensor.transfer = transfer;
  prepare_step(job, cpu_engines(), observer);
  return capture;
}

}  // namespace cnerf::pipeline
