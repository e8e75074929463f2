/// What `cnerf view RUN` shows: run.json, take.json of the take "one" and bundle.json of its bake, in three pieces.

#include "src/pipeline/shown_bundle.h"
#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(shown_bundle) {
  using namespace cnerf;
  const auto pieces = fuzz::pieces_of(input, 3);
  const auto run = fuzz::scratch_file("shown/run.json", pieces[0]).parent_path();
  (void)fuzz::scratch_file("shown/takes/one/take.json", pieces[1]);
  for (const char* bake : {"grey", "one"}) {
    (void)fuzz::scratch_file(std::string("shown/bakes/") + bake + "/web/bundle.json", pieces[2]);
  }
  fuzz::read_or_refuse(run, [&] {
    Observer observer;
    const auto bundle = pipeline::bundle_to_show({run, "", {}}, {}, observer).lexically_normal();
    if (!bundle.string().starts_with((run / "bakes").string())) {
      throw fuzz::Finding("a run's bundle lies outside of the run: " + bundle.string());
    }
  });
}
