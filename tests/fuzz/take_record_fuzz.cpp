/// take.json.

#include "src/pipeline/run_directory.h"
#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(take_record) {
  using namespace cnerf;
  const auto file = fuzz::scratch_file("takes_of/takes/one/take.json", input);
  const pipeline::RunDirectory run(fuzz::scratch_folder() / "takes_of");
  fuzz::read_or_refuse(file, [&] { return run.take_record("one"); });
}
