#include "src/prepare/video.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <opencv2/videoio.hpp>

#include "src/base/error.h"
#include "src/base/statistics.h"
#include "src/capture/image_io.h"
#include "src/picture/codecs.h"
#include "src/picture/encode.h"
#include "src/prepare/camera_motion.h"
#include "src/prepare/grey_image.h"

namespace cnerf::prepare {
namespace fs = std::filesystem;
namespace {

constexpr double kCombed = 1.0;           ///< comb ratio from which a frame is woven of two moments
constexpr double kInterlacedShare = 0.1;  ///< of frames, from which a clip is interlaced
constexpr double kJudgedMove = 0.08;      ///< of the diagonal: pairs this far apart are judged
constexpr double kParallaxShare = 0.25;   ///< of judged pairs, below which a shot has none
constexpr double kSurelyNoCut = 0.6;      ///< likeness to the frame before, above which places are followed on
constexpr int kTrackedWidth = 480;
constexpr int kMostTracks = 400, kFewestTracks = 60;

std::shared_ptr<cv::VideoCapture> open_clip(const fs::path& file) {
  auto clip = open_video(file.string(), cv::CAP_FFMPEG);
  if (!clip->isOpened()) throw InputError(file, "", "expected a film clip, found a file that FFmpeg cannot open");
  return clip;
}

/// One frame as grey codes: Rec.709 luminance of colours, the code itself where there are none.
cv::Mat1b grey_of(const cv::Mat& frame) {
  if (frame.channels() == 1) return frame;
  std::vector<cv::Mat1b> bgr;
  cv::split(frame, bgr);
  if (cv::norm(bgr[0], bgr[1], cv::NORM_INF) <= 2 && cv::norm(bgr[1], bgr[2], cv::NORM_INF) <= 2) return bgr[1];
  static const std::vector<float> linear = [] {
    std::vector<float> table(256);
    for (std::size_t i = 0; i < 256; ++i) table[i] = linear_from_srgb(float(i) / 255);
    return table;
  }();
  cv::Mat1b out(frame.size());
  for (int y = 0; y < frame.rows; ++y) {
    const auto* row = frame.ptr<cv::Vec3b>(y);
    for (int x = 0; x < frame.cols; ++x) {
      const float luminance = luminance_of<float>({linear[row[x][2]], linear[row[x][1]], linear[row[x][0]]});
      out(y, x) = srgb8_from_linear(luminance);
    }
  }
  return out;
}

/// A picture whose brightness and contrast are alike everywhere, so that flicker is not taken for motion.
/// @param textured  becomes 255 where there is more than grain to follow
cv::Mat1b evened_out(const cv::Mat1b& picture, cv::Mat1b& textured) {
  constexpr int kAround = 31;     // pixels
  constexpr double kTexture = 8;  // codes, standard deviation
  cv::Mat1f codes, mean, square;
  picture.convertTo(codes, CV_32F);
  cv::GaussianBlur(codes, codes, {}, 0.8);  // grain
  cv::blur(codes, mean, {kAround, kAround});
  cv::blur(codes.mul(codes), square, {kAround, kAround});
  cv::Mat1f deviation;
  cv::sqrt(cv::max(square - mean.mul(mean), 0), deviation);
  textured = deviation > kTexture;
  cv::Mat1b out;
  cv::Mat1f((codes - mean) / (deviation + kTexture)).convertTo(out, CV_8U, 48, 128);
  return out;
}

/// Follows places through a shot and judges pairs of frames between which they moved enough.
class MotionObserver {
 public:
  void add(const cv::Mat1b& frame) {
    const cv::Mat1b small = evened_out(reduced_to(frame, kTrackedWidth), textured_);
    if (!before_.empty() && !here_.empty()) follow(small);
    before_ = small;
    if (here_.size() < kFewestTracks) start();
  }
  /// A cut: nothing is followed across it.
  void cut() {
    judge();
    before_.release();
    here_.clear();
  }
  /// `before` with the verdicts since the last call appended.
  [[nodiscard]] std::vector<MotionVerdict> taken(std::vector<MotionVerdict> before) {
    before.insert(before.end(), verdicts_.begin(), verdicts_.end());
    verdicts_.clear();
    return before;
  }

 private:
  void start() {
    here_.clear();
    cv::goodFeaturesToTrack(before_, here_, kMostTracks, 0.01, 8, textured_);
    at_start_ = here_;
    followed_ = 0;
  }
  void follow(const cv::Mat1b& frame) {
    std::vector<cv::Point2f> there, back;
    std::vector<std::uint8_t> found, found_back;
    std::vector<float> error;
    cv::calcOpticalFlowPyrLK(before_, frame, here_, there, found, error, {21, 21}, 3);
    cv::calcOpticalFlowPyrLK(frame, before_, there, back, found_back, error, {21, 21}, 3);
    std::vector<cv::Point2f> from, to;
    for (std::size_t i = 0; i < here_.size(); ++i) {
      const cv::Point2f p = there[i];
      const bool inside = p.x >= 0 && p.y >= 0 && p.x < float(frame.cols) && p.y < float(frame.rows);
      if (found[i] == 0 || found_back[i] == 0 || !inside || cv::norm(back[i] - here_[i]) > 0.7) continue;
      from.push_back(at_start_[i]);
      to.push_back(p);
    }
    if (to.size() < kFewestTracks && followed_ > 0) {  // judge while enough are left
      judge();
      before_ = frame;
      start();
      return;
    }
    at_start_ = std::move(from);
    here_ = std::move(to);
    ++followed_;
    if (here_.size() >= kFewestTracks && moved() > kJudgedMove) {
      judge();
      before_ = frame;
      start();
    }
  }
  [[nodiscard]] double moved() const {
    std::vector<double> moves;
    for (std::size_t i = 0; i < here_.size(); ++i) moves.push_back(cv::norm(here_[i] - at_start_[i]));
    return median(std::move(moves)) / std::hypot(before_.cols, before_.rows);
  }
  void judge() {
    if (here_.size() < kFewestTracks || here_.size() != at_start_.size() || followed_ == 0) return;
    verdicts_.push_back(judge_motion(at_start_, here_, before_.size()));
  }

  cv::Mat1b before_, textured_;
  std::vector<cv::Point2f> at_start_, here_;
  int followed_ = 0;
  std::vector<MotionVerdict> verdicts_;
};

/// What one reading of the whole clip tells.
struct Survey {
  std::vector<FrameFacts> frames;
  std::vector<std::vector<MotionVerdict>> verdicts;  ///< by frame at which they fell
  cv::Size size;  ///< of a frame; a clip that says it was turned is turned back by OpenCV
  cv::Rect picture;
};

Survey survey(const fs::path& file, const ProgressSink& progress) {
  const auto clip = open_clip(file);
  const double expected = std::max(1.0, clip->get(cv::CAP_PROP_FRAME_COUNT));
  Survey out;
  FrameObserver observer;
  MotionObserver motion;
  BorderFinder borders;
  for (cv::Mat frame; clip->read(frame);) {
    if (interruption_requested()) throw Interrupted("stopped while reading the clip");
    const cv::Mat1b grey = grey_of(frame);
    out.frames.push_back(observer.measure(grey));
    borders.add(grey);
    if (out.frames.back().likeness < kSurelyNoCut && !out.verdicts.empty()) {
      motion.cut();
      out.verdicts.back() = motion.taken(std::move(out.verdicts.back()));
    }
    motion.add(grey);
    out.verdicts.push_back(motion.taken({}));
    if (progress) progress({"clip", 0.8 * std::min(1.0, double(out.frames.size()) / expected), {}});
  }
  if (out.frames.empty()) throw InputError(file, "frames", "expected at least 2, found none that can be decoded");
  motion.cut();
  out.verdicts.back() = motion.taken(std::move(out.verdicts.back()));
  out.picture = borders.picture();
  out.size = borders.size();
  return out;
}

ShotReport report_of(const Survey& clip, const Shot& range) {
  ShotReport out;
  out.range = range;
  const std::vector<bool> duplicates = find_duplicates(clip.frames, range);
  out.duplicates = int(std::ranges::count(duplicates, true));
  int parallax = 0;
  std::vector<double> moves;
  for (int i = range.begin + 1; i < range.end; ++i) {
    for (const MotionVerdict& verdict : clip.verdicts[std::size_t(i)]) {
      moves.push_back(verdict.moved);
      if (verdict.motion == Motion::kStill) continue;
      ++out.judged;
      parallax += verdict.motion == Motion::kParallax ? 1 : 0;
    }
  }
  out.parallax = out.judged > 0 ? double(parallax) / out.judged : 0;
  if (!moves.empty()) out.moved = median(std::move(moves));
  return out;
}

/// The shot asked for, or the longest usable one, or the longest.
std::size_t choose_shot(const std::vector<ShotReport>& shots, int wanted, const fs::path& file) {
  if (wanted > 0) {
    if (std::size_t(wanted) <= shots.size()) return std::size_t(wanted) - 1;
    throw UsageError(fmt::format("shot: expected 1 to {}, as {} has, found {}", shots.size(), file.string(), wanted));
  }
  std::size_t best = 0;
  for (std::size_t i = 1; i < shots.size(); ++i) {
    const bool usable = shots[i].refusal().empty(), best_usable = shots[best].refusal().empty();
    if (usable != best_usable ? usable : shots[i].range.size() > shots[best].range.size()) best = i;
  }
  return best;
}

/// Codes of a decoded frame to sRGB codes.
cv::Mat1b code_table(const VideoOptions& options, const SensorOptions& sensor, const fs::path& file) {
  const auto [black, white] =
      options.video_range == "limited" ? Levels{.black = 16, .white = 235} : levels_of(sensor, 255, file);
  const Transfer transfer = transfer_named(sensor.transfer);
  cv::Mat1b table(1, 256);
  for (int code = 0; code < 256; ++code) {
    const double value = std::clamp((code - black) / (white - black), 0.0, 1.0);
    table(code) = srgb8_from_linear(decode_transfer(transfer, float(value)));
  }
  return table;
}

/// The kept part of a frame: the picture without its borders; of interlaced frames the upper field.
cv::Mat1b kept_part(const cv::Mat1b& frame, const ClipReport& report) {
  const cv::Mat1b picture = frame(report.picture);
  if (!report.interlaced) return picture.clone();
  cv::Mat1b field((picture.rows + 1) / 2, picture.cols);
  for (int y = 0; y < field.rows; ++y) picture.row(2 * y).copyTo(field.row(y));
  return field;
}

PreparedImage describe(const ClipReport& report, const cv::Mat1b& picture, int frame) {
  PreparedImage image;
  image.name = fmt::format("frame_{:06}.png", frame);
  image.width = picture.cols;
  image.height = picture.rows;
  image.frame = frame;
  image.uncropped = std::max(report.width, report.height);
  image.pixel_aspect = report.pixel_aspect * (report.interlaced ? 0.5 : 1);
  // The optical axis goes through the middle of the frame as it was stored, wherever borders were cut.
  image.centre_x = 0.5 * report.width - report.picture.x;
  image.centre_y = 0.5 * report.height - report.picture.y;
  if (report.interlaced) image.centre_y = 0.5 * image.centre_y;
  return image;
}

/// The masks of a clip's frames, cut as the frames are.
class FrameMasks {
 public:
  FrameMasks(const fs::path& masks, const fs::path& capture, const ClipReport& report)
      : capture_(capture), report_(report) {
    if (fs::is_directory(masks)) {
      by_stem_ = masks_in(masks);
    } else if (!masks.empty()) {
      if (!fs::exists(masks)) throw MissingInputError(masks.string() + ": no such mask, or folder of masks");
      of_all_ = write(masks, "masks/every_frame.png");
    }
  }
  /// The frame's mask, below the capture; empty: none.
  [[nodiscard]] fs::path of(const std::string& name) {
    const auto found = by_stem_.find(fs::path(name).stem().string());
    if (found == by_stem_.end()) return of_all_;
    ++used_;
    return write(found->second, fs::path("masks") / name);
  }
  /// @throws InputError  when none of a folder's masks belongs to a frame.
  void check_used(const fs::path& masks, const std::string& name) const {
    if (by_stem_.empty() || used_ > 0) return;
    throw InputError(masks, "names", "expected masks named as the kept frames, e.g. " + name);
  }

 private:
  fs::path write(const fs::path& mask, const fs::path& name) const {
    std::vector<std::uint8_t> codes = read_mask(mask, report_.width, report_.height);
    write_png(capture_ / name, kept_part(cv::Mat1b(report_.height, report_.width, codes.data()), report_));
    return name;
  }

  fs::path capture_;
  const ClipReport& report_;
  std::map<std::string, fs::path> by_stem_;
  fs::path of_all_;
  int used_ = 0;
};

/// @param table  codes of a decoded frame -> sRGB codes
void write_frames(const fs::path& file, const fs::path& capture, FrameMasks& masks, const cv::Mat1b& table,
                  ClipImport& out, const ProgressSink& progress) {
  const auto frames = open_clip(file);
  std::size_t next = 0;
  const std::vector<int>& kept = out.report.kept;
  for (int number = 0; next < kept.size() && frames->grab(); ++number) {
    if (number != kept[next]) continue;
    cv::Mat frame;
    if (!frames->retrieve(frame)) break;
    cv::Mat1b codes;
    cv::LUT(kept_part(grey_of(frame), out.report), table, codes);
    PreparedImage image = describe(out.report, codes, number);
    image.source = file;
    image.mask = masks.of(image.name);
    write_png(capture / "images" / image.name, codes);
    out.set.images.push_back(std::move(image));
    ++next;
    if (progress) progress({"clip", 0.8 + 0.2 * double(next) / double(kept.size()), {}});
    if (interruption_requested()) throw Interrupted("stopped while writing frames");
  }
}

}  // namespace

std::string ShotReport::refusal() const {
  if (judged == 0) return moved >= 0 ? "the camera hardly moves" : "";  // too bare to tell: COLMAP shall try
  if (parallax < kParallaxShare) {
    return "no parallax: the camera turns or zooms on the spot (or the subject is flat), which tells no depth";
  }
  return "";
}

bool is_clip(const fs::path& file) {
  std::error_code failure;
  return fs::is_regular_file(file, failure) && open_video(file.string(), cv::CAP_FFMPEG)->isOpened();
}

std::vector<std::string> shot_lines(const ClipReport& report) {
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < report.shots.size(); ++i) {
    const ShotReport& shot = report.shots[i];
    const double fps = report.fps > 0 ? report.fps : 24;
    const std::string refusal = shot.refusal();
    lines.push_back(fmt::format("shot {}: frames {} to {}, {:.1f} s{}{}", i + 1, shot.range.begin, shot.range.end - 1,
                                shot.range.size() / fps,
                                shot.duplicates > 0 ? fmt::format(", {} repeated", shot.duplicates) : "",
                                refusal.empty() ? "" : "; " + refusal));
  }
  return lines;
}

ClipImport import_clip(const fs::path& file, const fs::path& capture, const fs::path& masks,
                       const VideoOptions& options, const SensorOptions& sensor, const ProgressSink& progress) {
  ClipImport out;
  ClipReport& report = out.report;
  const cv::Mat1b table = code_table(options, sensor, file);
  {
    const auto clip = open_clip(file);
    report.fps = clip->get(cv::CAP_PROP_FPS);
    const double across = clip->get(cv::CAP_PROP_SAR_NUM), up = clip->get(cv::CAP_PROP_SAR_DEN);
    if (across > 0 && up > 0) report.pixel_aspect = across / up;
  }
  const Survey clip = survey(file, progress);
  report.frames = int(clip.frames.size());
  report.width = clip.size.width;
  report.height = clip.size.height;
  report.picture = clip.picture;
  const auto combed = std::ranges::count_if(clip.frames, [](const FrameFacts& f) { return f.comb > kCombed; });
  report.combed = double(combed) / report.frames;
  report.interlaced = report.combed > kInterlacedShare;
  for (const Shot& range : find_shots(clip.frames)) report.shots.push_back(report_of(clip, range));
  if (report.shots.empty()) {
    throw InputError(file, "frames",
                     fmt::format("expected a shot of at least 5 frames, found {} frames", report.frames));
  }
  const std::size_t chosen = choose_shot(report.shots, options.shot, file);
  report.shot = int(chosen) + 1;
  const ShotReport& shot = report.shots[chosen];
  if (const std::string refusal = shot.refusal(); !refusal.empty() && !options.allow_no_parallax) {
    std::string list;
    for (const std::string& line : shot_lines(report)) list += "\n  " + line;
    throw PosesError(
        file.string() + ": shot " + std::to_string(report.shot) + ": " + refusal +
        ". A camera that travels is needed; --shot takes another shot, --allow-no-parallax goes on all the "
        "same." +
        list);
  }
  report.kept = choose_frames(clip.frames, shot.range, find_duplicates(clip.frames, shot.range), options.frames);
  FrameMasks frame_masks(masks, capture, report);
  write_frames(file, capture, frame_masks, table, out, progress);
  for (PreparedImage& image : out.set.images) image.sharpness = clip.frames[std::size_t(image.frame)].sharpness;
  if (!out.set.images.empty()) frame_masks.check_used(masks, out.set.images.front().name);
  if (out.set.images.size() < 2) {
    throw InputError(file, "frames", fmt::format("expected at least 2 to keep, found {}", out.set.images.size()));
  }
  return out;
}

}  // namespace cnerf::prepare
