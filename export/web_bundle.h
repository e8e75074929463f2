#pragma once
/// A volume as a folder that any static web server shows: the page, the bricks it draws, photographs and a poster.

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "bake/bake_camera.h"
#include "bake/baked_volume.h"
#include "export/web_bricks.h"
#include "export/web_options.h"
#include "export/web_pictures.h"

namespace cnerf {

inline constexpr int kWebSchema = 1;
inline constexpr const char* kWebManifest = "bundle.json";

/// How large a bundle will be.
struct WebEstimate {
  std::size_t download_bytes = 0;  ///< of the volume, from every sixteenth brick
  std::size_t texture_bytes = 0;   ///< in the browser's graphics memory
};
[[nodiscard]] WebEstimate estimate_web(const WebBricks& bricks);

/// What a bundle says besides the volume.
struct WebScene {
  std::string title;
  std::vector<BakeCamera> cameras;        ///< of the capture
  std::vector<WebPhoto> photos;           ///< one a camera, or none at all
  std::vector<std::string> command_line;  ///< recorded
  std::string units = "scene units", up_axis = "z";
};

struct WebReport {
  std::filesystem::path manifest;
  std::size_t volume_bytes = 0;  ///< of the packed bricks: what is loaded before the volume is seen
  std::size_t photo_bytes = 0;
  std::size_t page_bytes = 0;
};

/// Writes `occupancy.bin`, `density.bin`, `color.bin` (each one gzip member; layouts in docs/viewer.md), `poster.webp`,
/// `photos/NNN.jpg`, a copy of the page, and at the end bundle.json, which holds the SHA-256 of all of them, the frame,
/// the cameras and the colour spaces. Every file is whole or not there.
/// @param bricks  of `volume`; the volume itself is only looked at for the poster.
/// @param page    folder of the built page; empty = none, the bundle then needs `cnerf view` to be looked at.
/// @throws ContractError  when photos and cameras disagree in number.  @throws OutputError, MissingInputError.
WebReport write_web_bundle(const BakedVolume& volume, const WebBricks& bricks, const WebScene& scene,
                           const std::filesystem::path& folder, const std::filesystem::path& page,
                           const WebOptions& options);

}  // namespace cnerf
