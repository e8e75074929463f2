/// A configuration: one that a run wrote, and one of a user's, which is read more strictly. What is taken is written
/// and read back.

#include "src/base/files.h"
#include "src/config/config.h"
#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(config) {
  using namespace cnerf;
  const auto file = fuzz::scratch_file("config.toml", input);
  fuzz::read_or_refuse(file, [&] {
    Config config;
    (void)read_run_config(file, config);
    const std::string written = to_toml(config);
    Config again;
    (void)read_toml(written, file.string(), fields_of(again));
    if (to_toml(again) != written) throw fuzz::Finding("a configuration is read back as another one");
  });
  fuzz::read_or_refuse(file, [&] {
    Config config;
    (void)read_toml(read_text_file(file), file.string(), fields_of(config), retired_keys());
  });
}
