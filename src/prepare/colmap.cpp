#include "src/prepare/colmap.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/parallel.h"
#include "src/base/process.h"
#include "src/base/statistics.h"
#include "src/base/usage.h"
#include "src/capture/image_io.h"
#include "src/capture/listing.h"
#include "src/picture/encode.h"
#include "src/prepare/grey_image.h"
#include "src/prepare/image_pairs.h"

namespace cnerf::prepare {
namespace fs = std::filesystem;
namespace {

constexpr std::size_t kPairsACall = 40;   ///< matched by one call of COLMAP, at least
constexpr int kExhaustiveImages = 100;    ///< up to which all pairs are matched
constexpr int kExhaustiveFrames = 40;     ///< of a clip: where neighbours are known, all pairs are soon a waste
constexpr int kNeighbours = 10;           ///< matched on each side, where not all pairs are
constexpr int kAlike = 20;                ///< matched by look, where not all pairs are
constexpr int kColmapFeatures = 8192;     ///< of an image, at most
constexpr int kColmapSide = 1600;         ///< pixels at which features are looked for
constexpr int kViewsForLens = 6;          ///< of a camera, from which more than one number of its lens can be told
constexpr int kViewsForCentre = 15;       ///< the same, from which its principal point can be told from its turns
constexpr double kFarthestCentre = 0.05;  ///< of the longer side, by which a principal point may be off the middle
constexpr double kOddestAspect = 0.03;    ///< by which focal lengths may differ

/// The number at the start of `text`.
std::optional<double> leading_number(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(' ');
  if (begin == std::string_view::npos) return std::nullopt;
  int value = 0;
  if (std::from_chars(text.data() + begin, text.data() + text.size(), value).ec != std::errc()) return std::nullopt;
  return value;
}

/// One COLMAP program and its log.
class Colmap {
 public:
  Colmap(fs::path program, fs::path log) : program_(std::move(program)), log_(std::move(log)) {}

  /// The first of `names` that `command` knows: options were renamed over the years.
  [[nodiscard]] std::optional<std::string> option(const std::string& command,
                                                  std::initializer_list<const char*> names) {
    std::string& help = help_[command];
    if (help.empty()) help = help_text(command);
    for (const char* name : names) {
      if (help.find(std::string("--") + name) != std::string::npos) return std::string("--") + name;
    }
    return std::nullopt;
  }

  /// Appends an option with its value to the words of a command that knows it.
  void add(std::vector<std::string>& words, std::initializer_list<const char*> names, const std::string& value) {
    if (const auto name = option(words.front(), names)) words.insert(words.end(), {*name, value});
  }

  /// Runs one command, and reports the share its log tells as that of `task`.
  /// @return  false when it failed with `excuse` among its last words; every other failure throws.
  bool run(const std::vector<std::string>& words, const std::string& task, std::size_t images,
           const ProgressSink& progress, const std::string& excuse = "") {
    std::vector<std::string> line;
    // Killed with this process, however that ends: two at work in one folder would mix their models.
    if (find_program("setpriv")) line = {"setpriv", "--pdeathsig", "KILL"};
    line.push_back(program_.string());
    line.insert(line.end(), words.begin(), words.end());
    const std::uintmax_t begin = fs::exists(log_) ? fs::file_size(log_) : 0;
    double shown = 0;
    const auto watch = [&] {
      if (interruption_requested()) {
        throw Interrupted("stopped during " + task + "; what is finished is kept in " + log_.parent_path().string());
      }
      // Also where nothing moved: the sink may want to stop.
      shown = std::max(shown, std::min(share_in_log(log_tail(begin), images), 0.999));
      if (progress) progress({task, shown, {}});
    };
    if (progress) progress({task, 0, {}});
    const int status = run_program(line, log_, watch);
    if (status != 0) {
      if (!excuse.empty() && last_lines(begin).find(excuse) != std::string::npos) return false;
      throw PosesError(fmt::format("{} {} ended with {}; its last words:\n{}\nAll of them: {}", program_.string(),
                                   words.front(), status, last_lines(begin), log_.string()));
    }
    if (progress) progress({task, 1, {}});
    return true;
  }

 private:
  [[nodiscard]] std::string help_text(const std::string& command) const {
    const fs::path file = log_.parent_path() / (command + ".help");
    fs::remove(file);
    (void)run_program({program_.string(), command, "-h"}, file);
    std::string text = read_text_file(file) + " ";  // never empty again
    fs::remove(file);
    return text;
  }

  [[nodiscard]] std::string log_tail(std::uintmax_t begin) const {
    std::ifstream in(log_);
    in.seekg(std::streamoff(begin));
    return {std::istreambuf_iterator<char>(in), {}};
  }

  [[nodiscard]] std::string last_lines(std::uintmax_t begin) const {
    const std::string text = log_tail(begin);
    std::size_t from = text.size();
    for (int line = 0; line < 8 && from != std::string::npos && from > 0; ++line) from = text.rfind('\n', from - 1);
    return text.substr(from == std::string::npos ? 0 : from);
  }

  fs::path program_, log_;
  std::map<std::string, std::string> help_;  ///< by command
};

Colmap find_colmap(const fs::path& work) {
  if (const auto program = find_program("colmap")) return {*program, work / "colmap.log"};
  throw DeviceError(
      "no program colmap, which finds camera poses, on $PATH; install it (Debian: apt install colmap). The images are "
      "kept: the same command with --resume goes on");
}

/// What results depend on: another one means that earlier work is of no use.
std::string fingerprint(const std::vector<PreparedImage>& images, const fs::path& capture) {
  std::ostringstream text;
  for (const PreparedImage& image : images) {
    text << image.name << ' ' << image.camera << ' ' << image.focal << ' ' << image.mask.string() << ' '
         << sha256(read_binary_file(capture / "images" / image.name));
    if (!image.mask.empty()) text << ' ' << sha256(read_binary_file(capture / image.mask));
    text << '\n';
  }
  return text.str();
}

/// Which steps are finished, in a file of the work folder.
class Steps {
 public:
  Steps(fs::path work, const std::string& fingerprint) : work_(std::move(work)), file_(work_ / "steps.txt") {
    const std::string key = sha256(std::as_bytes(std::span(fingerprint.data(), fingerprint.size())));
    if (fs::exists(file_)) {
      std::istringstream in(read_text_file(file_));
      std::string found;
      in >> found;
      for (std::string step; in >> step;) done_.insert(step);
      if (found == key) {
        key_ = key;
        return;
      }
    }
    done_.clear();
    key_ = key;
    for (const char* derived : {"sparse", "free", "adjusted", "pictures", "masks"}) fs::remove_all(work_ / derived);
    save();
  }
  [[nodiscard]] bool has(const std::string& step) const { return done_.contains(step); }
  void finish(const std::string& step) {
    done_.insert(step);
    save();
  }

 private:
  void save() const {
    std::string text = key_ + "\n";
    for (const std::string& step : done_) text += step + "\n";
    write_file(file_, text);
  }
  fs::path work_, file_;
  std::string key_;
  std::set<std::string> done_;
};

/// The gain that brings the brightest thousandth of a picture to white; 1 where it is there nearly.
float display_gain(const LinearImage& image) {
  const float brightest = quantile(image.values, 0.999);
  return brightest > 0 && brightest < 0.5f ? 1 / brightest : 1.0f;
}

/// COLMAP looks at 8-bit copies of one brightness: it cannot read deep grey images, and sees little in dark ones.
/// @return  what each looks like from afar.
std::vector<LookVector> write_pictures(const std::vector<PreparedImage>& images, const fs::path& capture,
                                       const fs::path& folder) {
  std::vector<LookVector> looks(images.size());
  parallel_tasks(images.size(), [&](std::size_t i) {
    const LinearImage image = luminance_image(read_linear_image(capture / "images" / images[i].name, Transfer::kSrgb));
    const cv::Mat1b picture = grey_codes(image, display_gain(image));
    looks[i] = look_of(picture);
    write_png(folder / images[i].name, picture);
  });
  return looks;
}

void write_masks(const std::vector<PreparedImage>& images, const fs::path& capture, const fs::path& folder) {
  for (const PreparedImage& image : images) {
    if (image.mask.empty()) continue;
    make_folders(folder);
    fs::copy_file(capture / image.mask, folder / (image.name + ".png"), fs::copy_options::overwrite_existing);
  }
}

/// The start of an estimate: focal length from the file's notes, else COLMAP's rule of thumb of 1.2 times the longer
/// side; pixels that are not square give two.
std::string first_parameters(const PreparedImage& image) {
  const double focal = image.focal > 0 ? image.focal : 1.2 * std::max({image.width, image.height, image.uncropped});
  const bool centred = image.centre_x == 0 && image.centre_y == 0;
  const double cx = centred ? 0.5 * image.width : image.centre_x, cy = centred ? 0.5 * image.height : image.centre_y;
  if (image.pixel_aspect == 1) return fmt::format("{},{},{},0", focal, cx, cy);
  return fmt::format("{},{},{},{},0,0,0,0", focal / image.pixel_aspect, focal, cx, cy);
}

/// The lens that poses are found with. One focal length where pixels are known to be square: on an orbit, two of them
/// trade against the shape of the scene, and COLMAP settles on a wrong one. `free_lenses` frees the rest afterwards.
const char* mapping_model(const PreparedImage& image) {
  return image.pixel_aspect == 1 ? "SIMPLE_RADIAL" : "OPENCV";
}

void extract_features(Colmap& colmap, const std::vector<PreparedImage>& images, const fs::path& work,
                      const ProgressSink& progress) {
  std::map<int, std::vector<const PreparedImage*>> cameras;
  for (const PreparedImage& image : images) cameras[image.camera].push_back(&image);
  std::size_t before = 0;
  for (const auto& [number, members] : cameras) {
    std::string list;
    for (const PreparedImage* image : members) list += image->name + "\n";
    const fs::path list_file = work / fmt::format("camera_{}.txt", number);
    write_file(list_file, list);
    std::vector<std::string> words = {"feature_extractor",
                                      "--database_path",
                                      work / "database.db",
                                      "--image_path",
                                      work / "pictures",
                                      "--image_list_path",
                                      list_file,
                                      "--ImageReader.single_camera",
                                      "1",
                                      "--ImageReader.camera_model",
                                      mapping_model(*members.front()),
                                      "--ImageReader.camera_params",
                                      first_parameters(*members.front())};
    if (fs::exists(work / "masks")) words.insert(words.end(), {"--ImageReader.mask_path", work / "masks"});
    colmap.add(words, {"SiftExtraction.use_gpu", "FeatureExtraction.use_gpu"}, "0");
    colmap.add(words, {"SiftExtraction.num_threads", "FeatureExtraction.num_threads"}, std::to_string(thread_count()));
    colmap.add(words, {"SiftExtraction.max_image_size", "FeatureExtraction.max_image_size"},
               std::to_string(kColmapSide));
    colmap.add(words, {"SiftExtraction.max_num_features"}, std::to_string(kColmapFeatures));
    const auto scaled = [&, count = members.size()](const Progress& part) {
      if (!progress) return;
      const double done = double(before) + part.fraction * double(count);
      progress({part.task, done / double(images.size()), {}});
    };
    (void)colmap.run(words, "features", members.size(), scaled);
    before += members.size();
  }
}

/// In portions, each a call of its own: COLMAP's log tells nothing within one, and a finished one need not be repeated.
void match_features(Colmap& colmap, const std::vector<PreparedImage>& images,
                    const std::vector<std::pair<int, int>>& pairs, const fs::path& work, const ProgressSink& progress) {
  const std::size_t portion = std::max(kPairsACall, pairs.size() / 100);
  for (std::size_t begin = 0; begin < pairs.size(); begin += portion) {
    const std::size_t end = std::min(pairs.size(), begin + portion);
    std::string list;
    for (std::size_t k = begin; k < end; ++k) {
      list += images[std::size_t(pairs[k].first)].name + " " + images[std::size_t(pairs[k].second)].name + "\n";
    }
    write_file(work / "pairs.txt", list);
    std::vector<std::string> words = {"matches_importer",
                                      "--database_path",
                                      work / "database.db",
                                      "--match_list_path",
                                      work / "pairs.txt",
                                      "--match_type",
                                      "pairs"};
    colmap.add(words, {"SiftMatching.use_gpu", "FeatureMatching.use_gpu"}, "0");
    colmap.add(words, {"SiftMatching.num_threads", "FeatureMatching.num_threads"}, std::to_string(thread_count()));
    const auto scaled = [&](const Progress& part) {
      const double done = double(begin) + part.fraction * double(end - begin);
      if (progress) progress({part.task, done / double(pairs.size()), {}});
    };
    (void)colmap.run(words, "matches", images.size(), scaled);
  }
}

void map_images(Colmap& colmap, const std::vector<PreparedImage>& images, const fs::path& work,
                const ProgressSink& progress) {
  fs::remove_all(work / "sparse");
  make_folders(work / "sparse");
  std::vector<std::string> words = {"mapper",          "--database_path", work / "database.db", "--image_path",
                                    work / "pictures", "--output_path",   work / "sparse"};
  colmap.add(words, {"Mapper.num_threads"}, std::to_string(thread_count()));
  colmap.add(words, {"Mapper.extract_colors"}, "0");
  colmap.add(words, {"Mapper.min_model_size"},
             std::to_string(std::min<std::size_t>(10, std::max<std::size_t>(3, images.size() / 2))));
  (void)colmap.run(words, "poses", images.size(), progress, "failed to create sparse model");  // then there is none
}

/// The lens of each camera of a model, by the camera's number.
std::map<int, Intrinsics> lenses_of(const fs::path& model, const std::vector<PreparedImage>& images) {
  std::map<std::string, int> camera_of;
  for (const PreparedImage& image : images) camera_of[image.name] = image.camera;
  std::map<int, Intrinsics> out;
  for (const ListedView& view : read_colmap(model, model).views) {
    const auto found = camera_of.find(fs::path(view.name).filename().string());
    if (found != camera_of.end()) out[found->second] = view.intrinsics;
  }
  return out;
}

/// A text model's cameras with the lenses of OPENCV in place of those of SIMPLE_RADIAL, which are a case of them.
std::string with_full_lenses(const std::string& cameras) {
  std::istringstream in(cameras);
  std::string out;
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::string number, model, width, height, focal, cx, cy, k;
    words >> number >> model >> width >> height >> focal >> cx >> cy >> k;
    const bool is_simple = model == "SIMPLE_RADIAL";
    out += is_simple
               ? fmt::format("{} OPENCV {} {} {} {} {} {} {} 0 0 0", number, width, height, focal, focal, cx, cy, k)
               : line;
    out += '\n';
  }
  return out;
}

/// True where free lenses stayed near those they started from: too free for what the views tell, they run away.
bool is_plausible(const Intrinsics& lens, const Intrinsics& start) {
  const double moved = std::hypot(lens.cx - start.cx, lens.cy - start.cy) / std::max(start.width, start.height);
  const double aspect = lens.fx / lens.fy * start.fy / start.fx;
  return moved < kFarthestCentre && std::abs(aspect - 1) < kOddestAspect;
}

/// Adjusts the whole model once more, with lenses of all parameters: the mapper keeps them simple, with the axis in the
/// middle of the pictures, and turns every camera to make up for what that leaves out. The axis is free only where each
/// camera has views enough to tell it.
/// @return  the folder of the model to use: `model`, if the lenses became implausible.
fs::path free_lenses(Colmap& colmap, const fs::path& model, const std::vector<PreparedImage>& images,
                     const fs::path& work, const ProgressSink& progress) {
  std::map<int, int> views;
  for (const auto& image : images) ++views[image.camera];
  const int fewest = std::ranges::min_element(views, {}, &std::pair<const int, int>::second)->second;
  if (fewest < kViewsForLens) return model;
  const fs::path start = work / "free", adjusted = work / "adjusted";
  for (const fs::path& folder : {start, adjusted}) {
    fs::remove_all(folder);
    make_folders(folder);
  }
  (void)colmap.run({"model_converter", "--input_path", model, "--output_path", start, "--output_type", "TXT"}, "lenses",
                   images.size(), progress);
  write_file(start / "cameras.txt", with_full_lenses(read_text_file(start / "cameras.txt")));
  std::vector<std::string> words = {"bundle_adjuster", "--input_path", start, "--output_path", adjusted};
  if (fewest >= kViewsForCentre) colmap.add(words, {"BundleAdjustment.refine_principal_point"}, "1");
  (void)colmap.run(words, "lenses", images.size(), progress);
  const auto before = lenses_of(start, images), after = lenses_of(adjusted, images);
  const bool plausible = std::ranges::all_of(
      after, [&](const auto& camera) { return is_plausible(camera.second, before.at(camera.first)); });
  return plausible ? adjusted : model;
}

/// Of the lines "Features: 4218" of the log, one per image. Only the log tells them where no model was found.
double median_features(const fs::path& log) {
  const std::string text = fs::exists(log) ? read_text_file(log) : "";
  std::vector<double> counts;
  for (std::size_t at = text.find("Features:"); at != std::string::npos; at = text.find("Features:", at + 1)) {
    if (const auto count = leading_number(std::string_view(text).substr(at + 9))) counts.push_back(*count);
  }
  std::ranges::sort(counts);
  return counts.empty() ? 0 : counts[counts.size() / 2];
}

/// Models by registered images, most first.
std::vector<std::pair<std::size_t, fs::path>> models_in(const fs::path& folder) {
  std::vector<std::pair<std::size_t, fs::path>> models;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(folder, none)) {
    if (entry.is_directory()) models.emplace_back(colmap_image_count(entry.path()), entry.path());
  }
  std::ranges::sort(models, [](const auto& a, const auto& b) {
    return a.first != b.first ? a.first > b.first : a.second < b.second;
  });
  return models;
}

}  // namespace

double share_in_log(std::string_view log, std::size_t images) {
  constexpr std::string_view kFile = "Processed file [", kImage = "Registering image #";
  if (const std::size_t at = log.rfind(kFile); at != std::string_view::npos) {
    const std::string_view rest = log.substr(at + kFile.size());
    const std::size_t slash = rest.find('/');
    const auto done = leading_number(rest);
    const auto all = slash == std::string_view::npos ? std::nullopt : leading_number(rest.substr(slash + 1));
    if (done && all && *all > 0) return *done / *all;
  }
  if (const std::size_t at = log.rfind(kImage); at != std::string_view::npos) {
    const std::size_t bracket = log.find('(', at);
    const auto count = bracket == std::string_view::npos ? std::nullopt : leading_number(log.substr(bracket + 1));
    if (count) return std::min(1.0, *count / double(std::max<std::size_t>(1, images)));
  }
  return 0;
}

PoseRecovery recover_poses(const std::vector<PreparedImage>& images, const fs::path& capture, const fs::path& work,
                           bool ordered, const ProgressSink& progress) {
  const Stopwatch watch;
  make_folders(work);
  Colmap colmap = find_colmap(work);
  Steps steps(work, fingerprint(images, capture));

  PoseRecovery out;
  const int count = int(images.size());
  const bool all_pairs = count <= (ordered ? kExhaustiveFrames : kExhaustiveImages);
  out.matching = all_pairs ? "exhaustive" : "guided";
  const std::vector<LookVector> looks = write_pictures(images, capture, work / "pictures");
  write_masks(images, capture, work / "masks");
  const auto pairs = all_pairs ? choose_pairs(looks, {count, 0}) : choose_pairs(looks, {kNeighbours, kAlike});
  out.pairs = pairs.size();
  if (!steps.has("features")) {
    // Going on in the middle of a camera's images would give it a second lens.
    for (const char* file : {"database.db", "database.db-shm", "database.db-wal"}) fs::remove(work / file);
    extract_features(colmap, images, work, progress);
    steps.finish("features");
  }
  if (!steps.has("matches")) {
    match_features(colmap, images, pairs, work, progress);
    steps.finish("matches");
  }
  if (!steps.has("poses")) {
    map_images(colmap, images, work, progress);
    steps.finish("poses");
  }
  for (const auto& [registered, model] : models_in(work / "sparse")) {
    if (out.model.empty()) out.model = model;
    out.model_sizes.push_back(registered);
  }
  out.median_features = median_features(work / "colmap.log");
  if (!out.model.empty()) out.model = free_lenses(colmap, out.model, images, work, progress);
  out.seconds = watch.seconds();
  return out;
}

}  // namespace cnerf::prepare
