/// run.json, and the current take that it names.

#include "src/pipeline/run_directory.h"
#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(run_record) {
  using namespace cnerf;
  const auto file = fuzz::scratch_file("run/run.json", input);
  const pipeline::RunDirectory run(file.parent_path());
  fuzz::read_or_refuse(file.parent_path(), [&] {
    (void)json_of(run.record()).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
    const std::filesystem::path folder = run.take_folder(run.record().current_take).lexically_normal();
    if (!folder.string().starts_with((file.parent_path() / "takes").string())) {
      throw fuzz::Finding("a run's take lies outside of the run: " + folder.string());
    }
    return run.choose_take("");
  });
}
