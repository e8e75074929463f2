#include "src/app/prepare_step.h"

#include "src/base/error.h"
#include "src/base/files.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

/// The mark of a folder that preparing began, so that nothing else is ever cleared.
constexpr const char* kMark = "work/source.txt";

bool is_empty_or_missing(const fs::path& folder) {
  std::error_code failure;
  return !fs::exists(folder, failure) || (fs::is_directory(folder, failure) && fs::is_empty(folder, failure));
}

}  // namespace

void prepare_step(const fs::path& source, const fs::path& out, const PrepareOptions& options,
                  const ExistingOutput& existing, Reporter& reporter) {
  if (!fs::exists(source)) throw MissingInputError(source.string() + ": no such file or folder");
  const bool finished = fs::exists(out / "transforms.json");
  const bool ours = fs::exists(out / kMark);
  const std::string origin = fs::absolute(source).lexically_normal().string() + "\n";
  if (ours && existing.resume && read_text_file(out / kMark) != origin) {
    throw UsageError(out.string() + ": was begun for another source, " + read_text_file(out / kMark) +
                     "pass --overwrite, or choose another folder");
  }
  if (finished && ours && existing.resume) {
    reporter.say("capture: " + out.string() + " was prepared before");
    return;
  }
  if (!is_empty_or_missing(out)) {
    if (!ours) throw UsageError(out.string() + ": is not empty and holds no prepared capture; choose another folder");
    if (!existing.resume && !existing.overwrite) {
      throw UsageError(out.string() +
                       (finished ? ": holds a capture already; pass --overwrite to make it again"
                                 : ": was begun already; pass --resume to go on or --overwrite to start again"));
    }
    if (existing.overwrite) {
      for (const char* made : {"images", "masks", "work", "transforms.json", "prepare.json", "contact_sheet.png"}) {
        fs::remove_all(out / made);
      }
    }
  }
  write_file(out / kMark, origin);
  prepare_capture(source, out, options, reporter.sink(), [&](const std::string& text) { reporter.say(text); });
  reporter.wrote("contact sheet", out / "contact_sheet.png");
  reporter.wrote("capture", out);
}

fs::path capture_of(const fs::path& source, const fs::path& run, Reporter& reporter) {
  if (!needs_preparing(source)) return source;
  fs::path folder = fs::absolute(run).lexically_normal();
  if (folder.filename().empty()) folder = folder.parent_path();
  const fs::path capture = folder.parent_path() / (folder.filename().string() + "-capture");
  reporter.say("no camera poses in " + source.string() + ": preparing a capture (cnerf prepare has options for this)");
  prepare_step(source, capture, {}, {.resume = true}, reporter);
  return capture;
}

}  // namespace cnerf
