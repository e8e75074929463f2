/// manifest.json of a bake, and the files that it names.

#include "export/manifest.h"
#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(bake_manifest) {
  using namespace cnerf;
  const auto file = fuzz::scratch_file("bake/manifest.json", input);
  const auto folder = file.parent_path();
  if (!std::filesystem::exists(folder / "volume.vdb")) (void)fuzz::scratch_file("bake/volume.vdb", {});
  fuzz::read_or_refuse(folder, [&] {
    const exporting::BakeManifest manifest = exporting::read_manifest(file);
    for (const std::string& name : manifest.files) {
      const auto inside = exporting::file_below(folder, name);
      if (inside && inside->parent_path() != std::filesystem::canonical(folder)) {
        throw fuzz::Finding("a file of a bake lies outside of it: " + inside->string());
      }
    }
    if (manifest.volume) exporting::check_listed_file(manifest, folder, manifest.volume->file);
  });
}
