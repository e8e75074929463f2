#include "src/pipeline/render_bake.h"
#include "src/cluster/share_out.h"

#include <algorithm>
#include <vector>

#include "bake/volume/integrate.h"
#include "export/manifest.h"
#include "export/vdb_reader.h"
#include "export/web_pictures.h"
#include "src/base/error.h"
#include "src/capture/picture_names.h"
#include "src/picture/encode.h"
#include "src/pipeline/picture_files.h"
#include "src/pipeline/run_context.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;

CameraPath cameras_of_bake(const fs::path& bake) {
  const exporting::BakeManifest manifest = exporting::read_manifest(bake / "manifest.json");
  if (!manifest.volume) {
    throw InputError(bake / "manifest.json", "volume", "this bake has none; bake with --format vdb");
  }
  CameraPath path{"cameras", {}};
  PictureNames names;
  for (const bake::Camera& camera : manifest.cameras) {
    path.cameras.push_back(
        {names.name_for(camera.name), exporting::without_distortion(camera.intrinsics), camera.world_from_camera});
  }
  return path;
}

void render_bake(const fs::path& bake, const CameraPath& path, const fs::path& folder, bool overwrite,
                 Observer& observer) {
  const FolderLock lock = lock_folder(folder.parent_path(), FolderLock::Mode::kAlone, observer);
  cluster::world().barrier("begin of a step");
  const std::vector<bake::Volume> volumes = exporting::read_volumes(bake);
  const auto write = [&](std::size_t i) {
    const PathCamera& camera = path.cameras[i];
    const bake::VolumeImage image = integrate_volumes(volumes, camera.intrinsics, camera.world_from_camera);
    write_png(folder / (camera.name + ".png"), picture_from_linear(image.width, image.height, image.rgb));
  };
  const auto done = [&](std::size_t i) {
    observer.report_progress({"render", double(i + 1) / double(path.cameras.size()), {}});
    if (observer.is_cancelled()) throw Interrupted("stopped");
  };
  cluster::share_out(cluster::world(), path.cameras.size(), write, done);
  if (overwrite && cluster::world().is_first()) remove_other_frames(folder, ".png", path);
  observer.wrote("pictures", folder);
}

}  // namespace cnerf::pipeline
