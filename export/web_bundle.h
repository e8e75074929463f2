#pragma once
/// A volume as a folder that any static web server shows: the page, the bricks it draws, photographs and a poster.

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "bake/camera.h"
#include "bake/volume.h"
#include "export/options.h"
#include "export/web_bricks.h"
#include "export/web_pictures.h"
#include "src/base/observer.h"
#include "src/picture/sky_picture.h"

namespace cnerf::exporting {

inline constexpr int kWebSchema = 2;
inline constexpr const char* kWebManifest = "bundle.json";

/// What the page shows of a bake.
struct WebVolume {
  std::vector<WebBricks> levels;  ///< coarsest first, as make_web_levels makes them
  SceneFrame frame;
  std::vector<std::byte> poster;  ///< WebP of what the first camera sees; empty = none
};

/// What a bundle says besides the volume.
struct WebScene {
  std::string title;
  std::vector<bake::Camera> cameras;  ///< of the capture
  std::vector<WebPhoto> photos;       ///< one a camera, or none at all
  Label label;
  std::optional<SkyPicture> sky = {};  ///< behind the volume
};

struct WebReport {
  std::filesystem::path manifest;
  std::size_t volume_bytes = 0;  ///< of the packed bricks: what is loaded before the volume is seen
  std::size_t photo_bytes = 0;
  std::size_t page_bytes = 0;
};

/// Writes for each level `occupancy.bin`, `density.bin` and `color.bin`, of finer ones `occupancy_fine1.bin` and so on
/// (each one gzip member; layouts in docs/viewer.md), `poster.webp`, `sky.jpg`, `photos/NNN.jpg`, a copy of the page,
/// and at the end bundle.json, which holds the SHA-256 of all of them, the frame, the cameras and the colour spaces.
/// Every file is whole or not there; levels of a former bundle that this one does not have are removed.
/// @param page    folder of the built page; empty = none, the bundle then needs `cnerf view` to be looked at.
/// @throws ContractError  when photos and cameras disagree in number, or there is no level.
/// @throws OutputError, MissingInputError.
WebReport write_web_bundle(const WebVolume& volume, const WebScene& scene, const std::filesystem::path& folder,
                           const std::filesystem::path& page);

/// The grids of a bake as the page shows them, each averaged to `options.resolution` first. The observer hears sizes.
/// @param volumes  nested grids, finest first; colours are dilated.
/// @param cameras  of the capture; the first one sees the poster
/// @throws UsageError  when they have more bricks than a page takes.
[[nodiscard]] WebVolume make_web_volume(std::vector<bake::Volume> volumes, const std::vector<bake::Camera>& cameras,
                                        const WebOptions& options, Observer& observer);

/// Writes their bundle, as write_web_bundle, and tells the observer of it.
void write_web(const WebVolume& volume, const WebScene& scene, const std::filesystem::path& folder,
               const std::filesystem::path& page, Observer& observer);

/// Both in one.
void write_web(std::vector<bake::Volume> volumes, const WebScene& scene, const std::filesystem::path& folder,
               const std::filesystem::path& page, const WebOptions& options, Observer& observer);

}  // namespace cnerf::exporting
