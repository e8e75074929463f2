#include "src/pipeline/run_directory.h"

#include <fmt/format.h>

#include <algorithm>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/folder_lock.h"
#include "src/base/text.h"
#include "src/base/usage.h"
#include "src/pipeline/version.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;
namespace {

struct Version {
  int schema_version = 0;
  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("schema_version", self.schema_version);
  }
};

/// @throws SnapshotError  naming the field; also for a record of a newer program
template <typename Record>
Record read_run_record(const fs::path& file) {
  const auto json = read_json<SnapshotError>(file);
  const int version = record_of<Version, SnapshotError>(json, file).schema_version;
  if (version > kRunSchemaVersion) {
    throw SnapshotError(
        fmt::format("{}: schema_version: this program reads up to {}, the file has {}; it was written by a newer cnerf",
                    file.string(), kRunSchemaVersion, version));
  }
  return record_of<Record, SnapshotError>(json, file);
}

template <typename Record>
void write_run_record(const fs::path& file, const Record& record) {
  write_file(file, json_of(record).dump(2) + "\n");
}

bool is_folder_name_character(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_' || c == '.';
}

bool is_take_name(const std::string& name) {
  return !name.empty() && name[0] != '.' && std::ranges::all_of(name, is_folder_name_character);
}

}  // namespace

RunDirectory RunDirectory::open(const fs::path& root) {
  const RunDirectory run(root);
  std::error_code failure;
  if (!fs::exists(root, failure)) throw MissingInputError(root.string() + ": no such run folder");
  if (!run.exists()) throw MissingInputError(root.string() + ": is not a run: it holds no run.json");
  return run;
}

fs::path RunDirectory::take_snapshot(const std::string& take) const {
  return take_folder(take) / "take.snapshot";
}
fs::path RunDirectory::take_record_file(const std::string& take) const {
  return take_folder(take) / "take.json";
}
fs::path RunDirectory::take_config_file(const std::string& take) const {
  return take_folder(take) / "config.toml";
}
fs::path RunDirectory::renders(const std::string& take) const {
  return root_ / "renders" / (take.empty() ? kGreyTake : take);
}
fs::path RunDirectory::bakes(const std::string& take) const {
  return root_ / "bakes" / (take.empty() ? kGreyTake : take);
}

bool RunDirectory::exists() const {
  std::error_code failure;
  return fs::is_regular_file(record_file(), failure);
}

RunRecord RunDirectory::record() const {
  auto record = read_run_record<RunRecord>(record_file());
  // It becomes the name of folders, in which later commands read, write and clear.
  if (!record.current_take.empty() && !is_take_name(record.current_take)) {
    throw SnapshotError(record_file().string() + ": current_take: expected letters, digits, '-', '_' and '.', found " +
                        excerpt(nlohmann::json(record.current_take)));
  }
  return record;
}

void RunDirectory::save(RunRecord record) const {
  record.schema_version = kRunSchemaVersion;
  record.peak_memory_bytes = std::max(record.peak_memory_bytes, peak_memory_bytes());
  write_run_record(record_file(), record);
}

void RunDirectory::update(const std::function<void(RunRecord&)>& change) const {
  const RecordTurn turn(root_);
  RunRecord changed = record();
  change(changed);
  save(std::move(changed));
}

std::vector<std::string> RunDirectory::take_names() const {
  std::vector<std::string> names;
  std::error_code failure;
  for (const auto& entry : fs::directory_iterator(root_ / "takes", failure)) {
    names.push_back(entry.path().filename().string());
  }
  std::ranges::sort(names);
  return names;
}

std::optional<TakeRecord> RunDirectory::take_record(const std::string& take) const {
  const fs::path file = take_record_file(take);
  std::error_code failure;
  if (!fs::is_regular_file(file, failure)) return std::nullopt;
  return read_run_record<TakeRecord>(file);
}

void RunDirectory::save(TakeRecord record) const {
  record.schema_version = kRunSchemaVersion;
  record.program_version = version_text();
  record.acceptance_rate =
      double(record.stage2.accepted) / std::max(1, record.stage2.accepted + record.stage2.rejected);
  write_run_record(take_record_file(record.name), record);
}

Config RunDirectory::config(const std::string& take, Observer& observer) const {
  Config config;
  std::error_code failure;
  const bool of_take = !take.empty() && fs::is_regular_file(take_config_file(take), failure);
  for (const std::string& note : read_run_config(of_take ? take_config_file(take) : config_file(), config)) {
    observer.say("note: " + note);
  }
  return config;
}

std::string RunDirectory::choose_take(const std::string& wanted) const {
  if (wanted == kGreyTake && !take_record(wanted)) return "";
  const std::string take = wanted.empty() ? record().current_take : wanted;
  if (take.empty() || take_record(take)) return take;
  std::vector<std::string> finished = take_names();
  std::erase_if(finished, [&](const std::string& name) { return !take_record(name); });
  const std::string asked = wanted.empty() ? record_file().string() + ": current_take" : root_.string();
  throw MissingInputError(asked + ": no finished take '" + take + "' (there are: " +
                          (finished.empty() ? "none; make one with cnerf colorize" : joined(finished, ", ")) + ")");
}

std::string RunDirectory::free_take_name(const std::string& base) const {
  std::error_code failure;
  std::string name = base;
  for (int i = 2; fs::exists(take_folder(name), failure); ++i) name = base + "-" + std::to_string(i);
  return name;
}

void RunDirectory::clear() const {
  for (const char* name : {"config.toml", "run.json", "stage1.snapshot", "takes", "renders", "bakes", "metrics.json",
                           "contact_sheet.png", "bases.png", "key_views.png", "key_views.json"}) {
    remove_output(root_ / name);
  }
}

std::unique_ptr<Scene> load_scene(const RunDirectory& directory, const std::string& take, const Finish& finish,
                                  const Engines& engines) {
  return Scene::load(directory.stage1_snapshot(), take.empty() ? fs::path() : directory.take_snapshot(take), finish,
                     engines);
}

std::string colorizer_name(const RunDirectory& directory, const std::string& take) {
  const auto record = directory.take_record(take);
  return record ? record->colorizer : "";
}

void note_time(const RunDirectory& directory, const char* step, const Stopwatch& watch) {
  directory.update([&](RunRecord& record) { record.seconds_of_steps[step] = watch.seconds(); });
}

void check_take_name(const std::string& name) {
  if (is_take_name(name)) return;
  throw UsageError("--take: expected letters, digits, '-', '_' and '.', got '" + name + "'");
}

}  // namespace cnerf::pipeline
