#pragma once
/// A trained scene, loaded for rendering, evaluation and baking.

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "src/base/options.h"
#include "src/base/progress.h"
#include "src/capture/camera.h"
#include "src/engine/engines.h"
#include "src/field/color_field.h"
#include "src/field/finish.h"
#include "src/picture/sky_picture.h"
#include "src/train/luminance/seen_scene.h"

namespace cnerf {

/// One rendered view. Linear light, composited over the sky, or over black where there is none; [H, W] each.
struct RenderedImage {
  int width = 0, height = 0;
  std::vector<float> luminance;  ///< linear Y
  std::vector<float> opacity;    ///< 0..1; 1 everywhere where a sky is behind
  std::vector<float> depth;      ///< expected distance along the optical axis, world units; 0 where opacity < 0.5
  std::vector<float> rgb;        ///< [H, W, 3] linear Rec.709 by the paper's per-pixel decode; empty when not colorized
  std::vector<float> baked_rgb;  ///< [H, W, 3] linear Rec.709 composited from per-sample colour, as a bake shows it
};

struct RenderOptions {
  int steps_per_box = 512;          ///< march steps across the innermost cascade
  double min_transmittance = 1e-3;  ///< a ray ends below this, and counts as opaque
  bool color = true;                ///< also rgb, when the scene is colorized
  bool baked_color = false;         ///< also baked_rgb
  bool sky = true;                  ///< is behind what is seen, where there is one; else black
  /// Linear Y of samples at positions in unit space, exposed as `query_luminance` has it, in place of the field's own,
  /// which depends on the view.
  std::function<void(std::span<const Vec3f> positions, std::span<float> luminance)> luminance = {};

  /// What samples are left out could change less than a grey level of an 8-bit picture.
  [[nodiscard]] RenderEffort effort() const { return {float(min_transmittance), 0.995f}; }
};

class Scene : public ColorField {
 public:
  /// @param take_snapshot  of stage 2; empty = luminance only.
  /// @throws MissingInputError, SnapshotError, DeviceError.
  static std::unique_ptr<Scene> load(const std::filesystem::path& stage1_snapshot,
                                     const std::filesystem::path& take_snapshot, const Engines& engines);
  /// The same in another light, and with its colours changed.
  static std::unique_ptr<Scene> load(const std::filesystem::path& stage1_snapshot,
                                     const std::filesystem::path& take_snapshot, const Finish& finish,
                                     const Engines& engines);

  [[nodiscard]] virtual bool is_colorized() const = 0;
  [[nodiscard]] virtual std::optional<SkyPicture> sky() const { return {}; }  ///< where views see one
  /// What its rays see before colours and finish, for whoever fits cameras to it. None where no trained field is
  /// behind.
  [[nodiscard]] virtual std::optional<SeenScene> seen(const RenderOptions& /*options*/) const { return {}; }
  [[nodiscard]] virtual std::string colorizer() const = 0;  ///< name of the colorizer; empty when not colorized
  [[nodiscard]] virtual RenderedImage render(const Intrinsics& intrinsics, const Affined& world_from_camera,
                                             const RenderOptions& options = {}) const = 0;
};

}  // namespace cnerf
