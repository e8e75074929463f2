#pragma once
/// A textured mesh and the capture's cameras -> glTF 2.0.

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "bake/camera.h"
#include "bake/mesh.h"
#include "export/options.h"
#include "src/base/vec3.h"

namespace cnerf::exporting {

/// What goes into the files beside the mesh.
struct GltfScene {
  std::vector<bake::Camera> cameras;     ///< of the capture
  std::vector<std::byte> basecolor_png;  ///< 8-bit sRGB
  Label label;
  std::string rgb_exr, luminance_exr, lab_exr, vdb, sky;  ///< names of files beside these, for `extras`; empty = none
};

struct GltfFiles {
  std::filesystem::path gltf, buffer, basecolor;  ///< `name`.gltf, `name`.bin, `name`_basecolor.png
  std::filesystem::path glb;                      ///< all in one
};

/// From the poses' frame: glTF is Y-up and in metres.
[[nodiscard]] Affined gltf_from_world(const WorldConvention& world);

/// Writes both forms into `folder`: an unlit material (KHR_materials_unlit; the light is in the texture), indexed
/// triangles with normals and texture coordinates, and a node for every camera, all placed by gltf_from_world. A
/// camera's lens distortion and principal point, which glTF has no place for, stand in its `extras`. Every file is
/// whole or not there, and a .gltf is written after what it refers to.
/// @throws ContractError  on an empty mesh or values that are not finite.  @throws OutputError.
GltfFiles write_gltf(const bake::Mesh& mesh, const GltfScene& scene, const std::filesystem::path& folder,
                     const std::string& name);

}  // namespace cnerf::exporting
