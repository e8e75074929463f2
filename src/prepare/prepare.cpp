#include "src/prepare/prepare.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/capture/listing.h"
#include "src/capture/load_capture.h"
#include "src/prepare/capture_writer.h"
#include "src/prepare/colmap.h"
#include "src/prepare/exposure.h"
#include "src/prepare/parallax.h"

namespace cnerf::prepare {
namespace fs = std::filesystem;
namespace {

using Json = nlohmann::ordered_json;

constexpr double kGoodShare = 0.8;    ///< of images registered, below which advice is given
constexpr double kLeastShare = 0.25;  ///< below which the poses are not worth a training
constexpr double kBlurred = 0.5;      ///< of the median sharpness
constexpr double kFewFeatures = 500;  ///< an image

/// Where the images came from.
struct Material {
  PhotographSet set;
  std::optional<ClipReport> clip;
  bool ordered = false;  ///< successive images are neighbours
};

/// The poses, in whatever frame they came.
struct Poses {
  std::vector<View> views;          ///< named as the images; no pixels
  std::vector<SparsePoint> points;  ///< `views` are places in these
  std::optional<PoseRecovery> recovery;
  fs::path model;
};

Material read_material(const fs::path& source, const fs::path& capture, const PrepareOptions& options,
                       const ProgressSink& progress, const Say& say) {
  Material out;
  if (fs::is_directory(source)) {
    out.set = import_photographs(list_photographs(source), capture, options.masks, options.sensor, progress);
    say(fmt::format("photographs: {} read{}", out.set.images.size(),
                    out.set.unreadable.empty() ? "" : fmt::format(", {} left out", out.set.unreadable.size())));
    for (const std::string& problem : out.set.unreadable) say("left out: " + problem);
    for (const std::string& note : out.set.notes) say("note: " + note);
    return out;
  }
  if (!fs::exists(source)) throw MissingInputError(source.string() + ": no such file or folder");
  if (source.extension() == ".dat") {
    if (!options.masks.empty()) throw UsageError("masks: expected with photographs or a clip, found a spike stream");
    out.set = import_spikes(source, capture, options.spikes, options.video.frames, progress);
    out.ordered = true;
    say(fmt::format("spike stream: {} pictures of {} ticks each", out.set.images.size(), options.spikes.spike_window));
    return out;
  }
  ClipImport clip = import_clip(source, capture, options.masks, options.video, options.sensor, progress);
  out.set = std::move(clip.set);
  out.clip = std::move(clip.report);
  out.ordered = true;
  const ClipReport& report = *out.clip;
  say(fmt::format("clip: {} frames of {} x {}, {:.3g} a second, {} shot{}", report.frames, report.width, report.height,
                  report.fps, report.shots.size(), report.shots.size() == 1 ? "" : "s"));
  for (const std::string& line : shot_lines(report)) say(line);
  say(fmt::format("shot {} is used, {} frames kept", report.shot, report.kept.size()));
  if (report.picture.width != report.width || report.picture.height != report.height) {
    say(fmt::format("borders cropped: {} x {} at {}, {} is left", report.picture.width, report.picture.height,
                    report.picture.x, report.picture.y));
  }
  if (report.interlaced) say("interlaced: the upper field of each frame is kept");
  return out;
}

/// Gives the views of a model the names of our images: those of COLMAP's own run, or those with the same stem.
Poses poses_of_model(const fs::path& model, const fs::path& capture, const std::vector<PreparedImage>& images) {
  const ImagePlaces places(images);
  std::map<std::size_t, std::string> listed_as;  // names in the model by the place
  Poses out;
  out.model = model;
  CaptureListing listing = read_colmap(capture, model);
  std::vector<ListedView> taken;
  for (const ListedView& listed : listing.views) {
    const auto found = places.of(listed.name);
    if (!found) continue;
    const PreparedImage& image = images[*found];
    const auto [other, is_first] = listed_as.try_emplace(*found, listed.name);
    if (!is_first) {
      throw InputError(model, "image " + listed.name,
                       "is of the same photograph as image " + other->second + ", " + image.source.string());
    }
    // COLMAP looks at pixels as they are stored, and our images were turned upright.
    if (image.orientation != 1 && listed.name != image.name) {
      throw InputError(model, "image " + listed.name,
                       "its photograph is turned by an EXIF note, which the model does not know; without the notes "
                       "(exiftool -Orientation= -overwrite_original FILES) both agree");
    }
    View view;
    view.name = image.name;
    view.image_file = capture / "images" / view.name;
    view.intrinsics = listed.intrinsics;
    view.world_from_camera = listed.world_from_camera;
    if (view.intrinsics.width != image.width || view.intrinsics.height != image.height) {
      throw InputError(model, "image " + listed.name,
                       fmt::format("expected the size of the photograph, {} x {}, found {} x {}", image.width,
                                   image.height, view.intrinsics.width, view.intrinsics.height));
    }
    out.views.push_back(std::move(view));
    taken.push_back(listed);
    taken.back().name = out.views.back().name;
  }
  std::ranges::sort(out.views, {}, &View::name);
  std::ranges::sort(taken, {}, &ListedView::name);
  listing.views = std::move(taken);
  out.points = points_by_place(listing);
  return out;
}

/// What may have kept images from being placed, as sentences.
std::string advice(const std::vector<PreparedImage>& images, const PoseRecovery& recovery, bool is_clip) {
  std::vector<double> values;
  for (const PreparedImage& image : images) values.push_back(image.sharpness);
  std::ranges::sort(values);
  const double usual = values[values.size() / 2];
  const auto blurred = std::ranges::count_if(values, [&](double v) { return v < kBlurred * usual; });
  std::string text;
  if (recovery.median_features > 0 && recovery.median_features < kFewFeatures) {
    text += fmt::format(
        " Pictures hold few details ({:.0f} features in the median one): more light, less blur, or a "
        "patterned cloth under the subject help.",
        recovery.median_features);
  }
  if (blurred > 0)
    text += fmt::format(" {} of {} pictures are much less sharp than the others.", blurred, images.size());
  if (recovery.model_sizes.size() > 1) {
    text += fmt::format(
        " {} groups of pictures do not connect: pictures in between, with two thirds of overlap, join "
        "them.",
        recovery.model_sizes.size());
  }
  text += is_clip ? " More frames (--frames) overlap more."
                  : " Neighbouring pictures should share two thirds of what they "
                    "show, from places a step apart.";
  return text;
}

std::string missing_names(const std::vector<PreparedImage>& images, const std::vector<View>& views) {
  std::string text;
  int count = 0;
  for (const PreparedImage& image : images) {
    if (std::ranges::any_of(views, [&](const View& view) { return view.name == image.name; })) continue;
    if (++count <= 8) text += (text.empty() ? "" : ", ") + image.name;
  }
  return text + (count > 8 ? fmt::format(" and {} more", count - 8) : "");
}

/// Photographs taken from one place give no depth, however long COLMAP works on them.
void refuse_turns(const std::vector<PreparedImage>& images, const fs::path& capture) {
  const ParallaxSurvey survey = survey_parallax(images, capture);
  if (!survey.only_turned()) return;
  throw PosesError(fmt::format(
      "no parallax: in {} of {} pairs of photographs the camera only turns or zooms on the spot (or the subject is "
      "flat), "
      "which tells no depth. Take the pictures from places a step apart; --allow-no-parallax goes on all the same.",
      survey.judged - survey.with_parallax, survey.judged));
}

/// Says how many images have poses, and which have none.
/// @param hints  what may help the others, as sentences
/// @throws PosesError  when they are too few to be worth a training
void report_placed(const Poses& poses, const std::vector<PreparedImage>& images, const std::string& hints,
                   const Say& say) {
  const std::size_t placed = poses.views.size();
  const double share = double(placed) / double(images.size());
  const std::string found = fmt::format("poses: {} of {} images placed", placed, images.size());
  const std::optional<PoseRecovery>& recovery = poses.recovery;
  if (share < kLeastShare || (recovery && placed < 3)) throw PosesError(found + "." + hints);
  say(recovery ? found + fmt::format(" ({} matching, {} pairs)", recovery->matching, recovery->pairs) : found);
  if (placed < images.size()) say("not placed: " + missing_names(images, poses.views));
  if (share < kGoodShare) say("advice:" + hints);
}

Poses find_poses(const Material& material, const fs::path& capture, const fs::path& work, const PrepareOptions& options,
                 const ProgressSink& progress, const Say& say) {
  const std::vector<PreparedImage>& images = material.set.images;
  if (!options.colmap_model.empty()) {
    Poses out = poses_of_model(options.colmap_model, capture, images);
    if (out.views.size() < 2) {
      throw InputError(options.colmap_model, "images",
                       fmt::format("expected the photographs' names, found {} of them", out.views.size()));
    }
    report_placed(out, images, " The model does not hold the others; without --colmap-model COLMAP looks for them.",
                  say);
    return out;
  }
  const bool is_clip = material.ordered;
  if (!is_clip && !options.video.allow_no_parallax) refuse_turns(images, capture);
  const PoseRecovery recovery = recover_poses(images, capture, work, is_clip, progress);
  Poses out;
  if (!recovery.model.empty()) out = poses_of_model(recovery.model, capture, images);
  out.recovery = recovery;
  const std::string log = " COLMAP's log: " + (work / "colmap.log").string();
  report_placed(out, images, advice(images, recovery, is_clip) + log, say);
  return out;
}

/// Finds exposures of the images, and haze if it is asked for, and says how they differ.
/// @throws InputError  where haze is asked for and the model does not tell it
void find_exposures(std::vector<PreparedImage>& images, const fs::path& capture, const fs::path& model, bool with_haze,
                    const Say& say) {
  const std::optional<double> spread = estimate_exposures(images, capture, model, with_haze);
  if (!spread && with_haze) {
    throw InputError(model, "images",
                     "expected points that they show, neither dark nor clipped, by which --haze is found, found none");
  }
  if (!spread) {
    say("exposures: taken as equal, since the model names no points that its images show, neither dark nor clipped");
    return;
  }
  say(fmt::format("exposures: {:.1f} % apart{}", 100 * *spread,
                  *spread >= kNotedExposure ? ", evened out when the capture is read" : ""));
}

/// The subject's box as it is found, or as it is given.
std::optional<SubjectBox> subject_of(const Poses& poses, const FrameOptions& options) {
  auto subject = find_subject(poses.views, positions_of(poses.points));
  if (options.box.empty()) return subject;
  if (!subject) subject.emplace();
  subject->box = parse_box(options.box);
  return subject;
}

Json json_of(const Similarity& s) {
  const Mat3d& r = s.rotation;
  Json rows = Json::array();
  for (const Vec3d& row : r.rows) rows.push_back({row.x, row.y, row.z});
  return {{"scale", s.scale}, {"rotation", rows}, {"translation", {s.translation.x, s.translation.y, s.translation.z}}};
}

Json json_of(const ClipReport& clip) {
  Json shots = Json::array();
  for (const ShotReport& shot : clip.shots) {
    shots.push_back({{"begin", shot.range.begin},
                     {"end", shot.range.end},
                     {"duplicates", shot.duplicates},
                     {"pairs_judged", shot.judged},
                     {"parallax_share", shot.parallax},
                     {"moved", shot.moved},
                     {"refusal", shot.refusal()}});
  }
  return {{"width", clip.width},
          {"height", clip.height},
          {"frames", clip.frames},
          {"fps", clip.fps},
          {"pixel_aspect", clip.pixel_aspect},
          {"interlaced", clip.interlaced},
          {"combed_share", clip.combed},
          {"picture", {clip.picture.x, clip.picture.y, clip.picture.width, clip.picture.height}},
          {"shots", shots},
          {"shot", clip.shot}};
}

Json json_of(const std::vector<PreparedImage>& images, const std::vector<View>& views) {
  Json out = Json::array();
  for (const PreparedImage& image : images) {
    Json one = {{"name", image.name},
                {"source", image.source.string()},
                {"camera", image.camera},
                {"sharpness", image.sharpness}};
    if (image.frame >= 0) one["frame"] = image.frame;
    if (image.exposure != 1) one["exposure"] = image.exposure;
    if (image.haze != 0) one["haze"] = image.haze;
    if (image.focal > 0) one["focal_pixels"] = image.focal;
    one["placed"] = std::ranges::any_of(views, [&](const View& view) { return view.name == image.name; });
    out.push_back(std::move(one));
  }
  return out;
}

Json json_of(const Aabbd& box) {
  return {{box.min.x, box.min.y, box.min.z}, {box.max.x, box.max.y, box.max.z}};
}

Json record_of(const fs::path& source, const PrepareOptions& options, const Material& material, const Poses& poses,
               const FrameChoice& frame, const std::optional<SubjectBox>& subject) {
  Json out;
  out["source"] = fs::absolute(source).lexically_normal().string();
  out["transfer"] = {{"source", options.sensor.transfer},
                     {"images", "srgb"},
                     {"black_level", options.sensor.black_level},
                     {"white_level", options.sensor.white_level}};
  if (material.clip) out["clip"] = json_of(*material.clip);
  out["unreadable"] = material.set.unreadable;
  Json& found = out["poses"];
  found["model"] = poses.model.string();
  found["placed"] = poses.views.size();
  found["images"] = material.set.images.size();
  if (poses.recovery) {
    found.update(Json{{"matching", poses.recovery->matching},
                      {"pairs", poses.recovery->pairs},
                      {"model_sizes", poses.recovery->model_sizes},
                      {"median_features", poses.recovery->median_features},
                      {"seconds", poses.recovery->seconds}});
  }
  out["frame"] = {{"up_by", frame.up_by},
                  {"ground_share", frame.ground_share},
                  {"unit", frame.metres ? "metre" : "unknown"},
                  {"measure", options.frame.measure},
                  {"capture_from_poses", json_of(frame.capture_from_poses)},
                  {"poses_from_capture", json_of(frame.capture_from_poses.inverse())}};
  if (subject)
    out["box"] = {{"by", options.frame.box.empty() ? "points" : "given"}, {"corners", json_of(subject->box)}};
  out["thresholds"] = {
      {"good_share", kGoodShare}, {"least_share", kLeastShare}, {"blurred", kBlurred}, {"few_features", kFewFeatures}};
  out["images"] = json_of(material.set.images, poses.views);
  return out;
}

}  // namespace

bool needs_preparing(const fs::path& source) {
  std::error_code failure;
  if (fs::is_regular_file(source, failure)) {
    const std::string extension = source.extension().string();
    const bool is_marker = extension == ".json" || extension == ".npy" || extension == ".bin" || extension == ".txt" ||
                           extension == ".xml" || extension == ".csv";
    return !is_marker && is_clip(source);
  }
  if (!fs::is_directory(source, failure)) return false;
  for (const char* marker : {"sparse", "colmap"}) {  // be their models whole or not
    if (fs::exists(source / marker, failure)) return false;
  }
  return !holds_poses(source) && holds_photographs(source);
}

void check_options(const PrepareOptions& options) {
  if (options.haze && options.no_exposure) {
    throw UsageError("haze, no_exposure: expected one of them, since haze is found together with exposures");
  }
  // What a file's own depth allows is known once it is read.
  const auto [black, white] = std::pair(options.sensor.black_level, options.sensor.white_level);
  if (white > 0 && black >= white) {
    throw UsageError(fmt::format("black_level: expected less than white_level, {:g}, found {:g}", white, black));
  }
  check_texts(options.frame);
}

PrepareReport prepare_capture(const fs::path& source, const fs::path& capture, const PrepareOptions& options,
                              const ProgressSink& progress, const Say& say) {
  Material material = read_material(source, capture, options, progress, say);
  Poses poses = find_poses(material, capture, capture / "work", options, progress, say);
  const FrameChoice frame = choose_frame(poses.views, positions_of(poses.points), options.frame);
  for (View& view : poses.views) view.world_from_camera = frame.capture_from_poses.pose(view.world_from_camera);
  for (SparsePoint& point : poses.points) point.position = frame.capture_from_poses.point(point.position);
  const auto subject = subject_of(poses, options.frame);
  say(fmt::format("frame: Z is up by {}, {}", frame.up_by,
                  frame.metres ? "in metres" : "no known unit (--measure gives metres)"));
  if (!options.no_exposure) find_exposures(material.set.images, capture, poses.model, options.haze, say);
  write_contact_sheet(capture / "contact_sheet.png", capture, poses.views, positions_of(poses.points), subject);
  const Json record = record_of(source, options, material, poses, frame, subject);
  // Names of files that were left out need not be in UTF-8.
  write_file(capture / "prepare.json", record.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
  const bool with_points = !poses.points.empty();
  if (with_points) write_file(capture / kPointsFile, points_text(poses.points));
  write_file(capture / "transforms.json",
             transforms_json(poses.views, material.set.images, subject, with_points).dump(1) + "\n");
  return {material.set.images.size(), poses.views.size()};
}

}  // namespace cnerf::prepare
