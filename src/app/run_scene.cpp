#include "src/app/run_scene.h"

namespace cnerf {

std::unique_ptr<Scene> load_scene(const RunDirectory& directory, const std::string& take, const Engines& engines) {
  return Scene::load(directory.stage1_snapshot(),
                     take.empty() ? std::filesystem::path() : directory.take_snapshot(take), engines);
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

}  // namespace cnerf
