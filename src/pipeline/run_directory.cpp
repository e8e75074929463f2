#include "src/pipeline/run_directory.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/usage.h"
#include "src/pipeline/version.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;
namespace {

using Json = nlohmann::ordered_json;

Json read_json(const fs::path& file) {
  try {
    Json json = Json::parse(read_text_file(file));
    const int version = json.at("schema_version").get<int>();
    if (version > kRunSchemaVersion) {
      throw SnapshotError(file.string() + ": schema_version: this program reads up to " +
                          std::to_string(kRunSchemaVersion) + ", the file has " + std::to_string(version) +
                          "; it was written by a newer cnerf");
    }
    return json;
  } catch (const nlohmann::json::exception& error) {
    throw SnapshotError(file.string() + ": " + error.what());
  }
}

/// Reads fields; a missing or mistyped one is the file's fault.
template <typename Read>
auto fields_from(const fs::path& file, const Json& json, Read&& read) {
  try {
    return read(json);
  } catch (const nlohmann::json::exception& error) {
    throw SnapshotError(file.string() + ": " + error.what());
  }
}

bool is_folder_name_character(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_' || c == '.';
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
  return fields_from(record_file(), read_json(record_file()), [](const Json& json) {
    RunRecord record;
    record.capture = json.at("capture").get<std::string>();
    record.program_version = json.at("program_version").get<std::string>();
    record.command_line = json.at("command_line").get<std::string>();
    record.current_take = json.at("current_take").get<std::string>();
    record.seconds_of_steps = json.at("seconds_of_steps").get<std::map<std::string, double>>();
    record.peak_memory_bytes = json.at("peak_memory_bytes").get<std::size_t>();
    const Json& stage1 = json.at("stage1");
    record.stage1_finished = stage1.at("finished").get<bool>();
    record.stage1 = {stage1.at("steps").get<int>(), stage1.at("seconds").get<double>(),
                     stage1.at("trained_samples").get<double>(), stage1.at("train_psnr").get<double>()};
    return record;
  });
}

void RunDirectory::save(const RunRecord& record) const {
  const Stage1Report& stage1 = record.stage1;
  const Json json{{"schema_version", kRunSchemaVersion},
                  {"program_version", record.program_version},
                  {"command_line", record.command_line},
                  {"capture", record.capture.string()},
                  {"current_take", record.current_take},
                  {"seconds_of_steps", record.seconds_of_steps},
                  {"peak_memory_bytes", std::max(record.peak_memory_bytes, peak_memory_bytes())},
                  {"stage1",
                   {{"finished", record.stage1_finished},
                    {"steps", stage1.steps},
                    {"seconds", stage1.seconds},
                    {"trained_samples", stage1.trained_samples},
                    {"train_psnr", stage1.train_psnr}}}};
  write_file(record_file(), json.dump(2) + "\n");
}

std::optional<TakeRecord> RunDirectory::take_record(const std::string& take) const {
  const fs::path file = take_record_file(take);
  std::error_code failure;
  if (!fs::is_regular_file(file, failure)) return std::nullopt;
  return fields_from(file, read_json(file), [](const Json& json) {
    TakeRecord record;
    record.name = json.at("name").get<std::string>();
    record.colorizer = json.at("colorizer").get<std::string>();
    record.stage2 = {json.at("accepted_patches").get<int>(), json.at("rejected_patches").get<int>(),
                     json.at("seconds").get<double>(),       json.at("colorizer_seconds").get<double>(),
                     json.value("waited_seconds", 0.0),      json.at("bake_ab_distance").get<double>()};
    return record;
  });
}

void RunDirectory::save(const TakeRecord& record) const {
  const Stage2Report& stage2 = record.stage2;
  const int answers = std::max(1, stage2.accepted + stage2.rejected);
  const Json json{{"schema_version", kRunSchemaVersion},
                  {"program_version", version_text()},
                  {"name", record.name},
                  {"colorizer", record.colorizer},
                  {"accepted_patches", stage2.accepted},
                  {"rejected_patches", stage2.rejected},
                  {"acceptance_rate", double(stage2.accepted) / answers},
                  {"seconds", stage2.seconds},
                  {"colorizer_seconds", stage2.colorizer_seconds},
                  {"waited_seconds", stage2.waited_seconds},
                  {"bake_ab_distance", stage2.bake_ab_distance}};
  write_file(take_record_file(record.name), json.dump(2) + "\n");
}

Config RunDirectory::config(const std::string& take) const {
  Config config;
  std::error_code failure;
  const bool of_take = !take.empty() && fs::is_regular_file(take_config_file(take), failure);
  read_run_config(of_take ? take_config_file(take) : config_file(), config);
  return config;
}

std::string RunDirectory::choose_take(const std::string& wanted) const {
  if (wanted == kGreyTake && !take_record(wanted)) return "";
  const std::string take = wanted.empty() ? record().current_take : wanted;
  if (take.empty() || take_record(take)) return take;
  std::string finished;
  std::error_code failure;
  for (const auto& entry : fs::directory_iterator(root_ / "takes", failure)) {
    const std::string name = entry.path().filename().string();
    if (take_record(name)) finished += (finished.empty() ? "" : ", ") + name;
  }
  throw MissingInputError(root_.string() + ": no finished take '" + take + "' (there are: " +
                          (finished.empty() ? "none; make one with cnerf colorize" : finished) + ")");
}

std::string RunDirectory::free_take_name(const std::string& base) const {
  std::error_code failure;
  std::string name = base;
  for (int i = 2; fs::exists(take_folder(name), failure); ++i) name = base + "-" + std::to_string(i);
  return name;
}

void RunDirectory::clear() const {
  for (const char* name : {"config.toml", "run.json", "stage1.snapshot", "takes", "renders", "bakes", "metrics.json",
                           "contact_sheet.png"}) {
    std::error_code failure;
    fs::remove_all(root_ / name, failure);
    if (failure) throw OutputError((root_ / name).string() + ": cannot be removed: " + failure.message());
  }
}

std::unique_ptr<Scene> load_scene(const RunDirectory& directory, const std::string& take, const Engines& engines) {
  return Scene::load(directory.stage1_snapshot(), take.empty() ? fs::path() : directory.take_snapshot(take), engines);
}

std::string colorizer_name(const RunDirectory& directory, const std::string& take) {
  const auto record = directory.take_record(take);
  return record ? record->colorizer : "";
}

void note_time(const RunDirectory& directory, const char* step, const Stopwatch& watch) {
  RunRecord record = directory.record();
  record.seconds_of_steps[step] = watch.seconds();
  directory.save(record);
}

void check_take_name(const std::string& name) {
  if (!name.empty() && name[0] != '.' && std::ranges::all_of(name, is_folder_name_character)) return;
  throw UsageError("--take: expected letters, digits, '-', '_' and '.', got '" + name + "'");
}

}  // namespace cnerf::pipeline
