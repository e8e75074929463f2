#include "src/studio/paint_files.h"

#include <algorithm>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/capture/picture_names.h"
#include "src/picture/encode.h"
#include "src/pipeline/run_context.h"
#include "src/studio/coloring.h"

namespace cnerf::studio {
namespace fs = std::filesystem;
namespace {

void require_take(const pipeline::RunDirectory& directory, const std::string& take) {
  pipeline::check_take_name(take);
  if (!directory.take_record(take)) throw UsageError("there is no finished take " + take);
}

bool is_readable(const pipeline::RunDirectory& directory, const std::string& take) {
  try {
    return directory.take_record(take).has_value();
  } catch (const Error&) {
    return false;
  }
}

/// The take that a journal begins from; empty = none, or it cannot be read, and repeats nothing.
std::string base_of(const fs::path& journal) {
  try {
    const auto content = read_record<Journal>(journal);
    return content.deeds.empty() ? "" : content.deeds.front().base;
  } catch (const Error&) {
    return "";
  }
}

/// Journals that begin from a take: those of finished takes, and that of what no take holds.
std::vector<fs::path> journals_begun_from(const pipeline::RunDirectory& directory, const std::string& take) {
  std::vector<fs::path> files = {directory.root() / "strokes" / kNowFile};
  for (const std::string& name : directory.take_names()) {
    if (fs::exists(directory.take_record_file(name))) files.push_back(directory.take_folder(name) / kJournalFile);
  }
  std::erase_if(files, [&](const fs::path& file) { return base_of(file) != take; });
  return files;
}

}  // namespace

cv::Mat colors_at_luminance(const RunningColors& colors, cv::Size size, std::uint8_t alpha,
                            const std::function<float(std::size_t pixel)>& luminance) {
  cv::Mat picture(size, CV_8UC4, cv::Scalar::all(0));
  for (std::size_t p = 0; p < colors.ab.size(); ++p) {
    if (!colors.is_known(p)) continue;
    const Vec3f rgb = linear_rgb_at(luminance(p), colors.ab[p]);
    auto& pixel = picture.at<cv::Vec4b>(int(p) / size.width, int(p) % size.width);
    pixel = {srgb8_from_linear(rgb.z), srgb8_from_linear(rgb.y), srgb8_from_linear(rgb.x), alpha};
  }
  return picture;
}

fs::path stroke_folder(const pipeline::RunContext& context) {
  return context.directory.root() / "strokes";
}

void copy_pictures(std::span<const Stroke> strokes, const PaintedPictures& from, const PaintedPictures& to) {
  for (const Stroke& stroke : strokes) {
    // Its name tells its content.
    if (stroke.picture.empty() || fs::exists(to.file(stroke.picture))) continue;
    write_file(to.file(stroke.picture), read_text_file(from.file(stroke.picture)));
  }
}

void write_strokes_whole(const fs::path& folder, const StrokeList& list, const PaintedPictures& from) {
  copy_pictures(list.strokes, from, PaintedPictures(folder));
  write_strokes(folder / kStrokeFile, list);
}

void write_paint_pictures(const fs::path& folder, const Capture& capture, const std::vector<Stroke>& strokes) {
  PictureNames names;
  for (const View& view : capture.views) {
    const fs::path file = folder / (names.name_for(view.name) + ".png");
    const bool is_touched = std::ranges::find(strokes, view.name, &Stroke::view) != strokes.end();
    const KnownColors paint =
        is_touched ? painted_on(view.name, strokes, view.image.width, view.image.height) : KnownColors{};
    std::error_code failure;
    if (std::ranges::find(paint.is_known, 1) != paint.is_known.end()) {
      write_png(file, colors_at_luminance(running_colors(paint), {paint.width, paint.height}, 255,
                                          [&](std::size_t p) { return view.image.stored_luminance(p); }));
    } else {
      fs::remove(file, failure);
    }
  }
}

void duplicate(const pipeline::RunDirectory& directory, const std::string& take, const std::string& name,
               Observer& observer) {
  require_take(directory, take);
  pipeline::check_take_name(name);
  const fs::path to = directory.take_folder(name);
  const FolderLock lock = pipeline::lock_folder(to, FolderLock::Mode::kAlone, observer);
  if (!is_vacant(to)) throw UsageError("a take of this name exists: " + name);
  const fs::path from = directory.take_folder(take);
  std::error_code failure;
  for (const auto& entry : fs::recursive_directory_iterator(from, failure)) {
    const fs::path& file = entry.path();
    // The record comes last: without it there is no take.
    const bool is_record = file == directory.take_record_file(take);
    if (is_record || !entry.is_regular_file() || file.filename() == FolderLock::kFile || is_temporary(file)) continue;
    write_atomically(to / file.lexically_relative(from), [&](const fs::path& temporary) {
      std::error_code problem;
      if (!fs::copy_file(file, temporary, fs::copy_options::overwrite_existing, problem)) {
        throw OutputError(file.string() + ": cannot be copied: " + problem.message());
      }
    });
  }
  pipeline::TakeRecord record = *directory.take_record(take);
  record.name = name;
  directory.save(record);
}

void rename(const pipeline::RunDirectory& directory, const std::string& take, const std::string& name,
            Observer& observer) {
  const std::vector<fs::path> journals = journals_begun_from(directory, take);
  std::vector<FolderLock> locks;  // before anything changes: all or nothing
  for (const fs::path& file : journals) {
    locks.push_back(pipeline::lock_folder(file.parent_path(), FolderLock::Mode::kAlone, observer));
  }
  duplicate(directory, take, name, observer);
  for (const fs::path& file : journals) {
    auto journal = read_record<Journal>(file);
    journal.deeds.front().base = name;
    write_journal(file, journal);
  }
  remove(directory, take, name, observer);
}

void remove(const pipeline::RunDirectory& directory, const std::string& take, const std::string& successor,
            Observer& observer) {
  require_take(directory, take);
  if (const auto journals = journals_begun_from(directory, take); !journals.empty()) {
    throw UsageError("take " + take + " is needed: " + journals.front().string() + " begins from it");
  }
  const fs::path folder = directory.take_folder(take);
  {
    const FolderLock lock = pipeline::lock_folder(folder, FolderLock::Mode::kAlone, observer);
    std::error_code failure;
    fs::remove(directory.take_record_file(take), failure);  // first: what is left is no take
    clear_folder(folder);
  }
  std::error_code failure;
  fs::remove_all(folder, failure);
  std::string other = successor;
  for (const std::string& name : directory.take_names()) {
    if (other.empty() && is_readable(directory, name)) other = name;
  }
  directory.update([&](pipeline::RunRecord& record) {
    if (record.current_take == take) record.current_take = other;
  });
}

}  // namespace cnerf::studio
