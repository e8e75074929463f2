#pragma once
/// Baking as a step of a run: a take as a volume, a mesh and textures for other programs.

#include <filesystem>
#include <string>

#include "export/web_bundle.h"
#include "src/engine/engines.h"
#include "src/pipeline/run_context.h"

namespace cnerf::pipeline {

/// What a bake writes.
struct BakeFormats {
  bool vdb = false;   ///< the volume
  bool gltf = false;  ///< a textured mesh, as .gltf and .glb
  bool exr = false;   ///< the mesh's textures in floating point, beside the mesh
  bool web = false;   ///< a folder with a page, for browsers
};
/// "vdb,gltf,exr,web" or some of them; exr brings the mesh along.  @throws UsageError.
[[nodiscard]] BakeFormats parse_bake_formats(const std::string& list);

/// The file that a bake of these formats writes last: once it is there, all of it is.
[[nodiscard]] std::filesystem::path last_file(const std::filesystem::path& folder, const BakeFormats& formats);
/// The folder of the web bundle of a bake.
[[nodiscard]] std::filesystem::path web_folder(const std::filesystem::path& bake);

struct BakeJob {
  std::string take;  ///< empty = grey
  std::filesystem::path folder;
  BakeFormats formats;
};

/// Bakes a take and writes the set-up script and the manifest beside it.
void bake_step(const RunContext& context, const BakeJob& job, const Engines& engines, Observer& observer);

/// Writes the web bundle of a volume; says its size before and after.
void write_web(const BakedVolume& volume, WebScene scene, const std::filesystem::path& folder,
               const WebOptions& options, Observer& observer);

}  // namespace cnerf::pipeline
