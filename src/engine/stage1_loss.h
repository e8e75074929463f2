#pragma once
/// The loss of stage 1 and its gradient along a ray, once for every device. Engines differ only in how they walk a
/// ray's samples: one after another on the processor, 32 at a time on the GPU.
///
///   L = ((L*(seen) - L*(wanted)) / 100)^2 + distortion_weight D + depth_weight M,   its mean over the rays of a step
///
/// `seen` composites the field's luminance, times the view's gain, over a random background, or over the sky where that
/// may be seen; `wanted` is the pixel over the same background, both as CIE lightness L*. D says how far apart the
/// ray's samples lie (distortion_math.h), M how far from where points are seen, where that is known (depth_math.h).

#include "src/base/host_device.h"
#include "src/color/colorspace_math.h"
#include "src/render/composite_math.h"
#include "src/render/depth_math.h"
#include "src/render/distortion_math.h"
#include "src/render/observed_ray.h"

namespace cnerf {

/// What a ray shows once all its samples are composited.
struct SeenRay {
  float luminance = 0;      ///< linear Y over black: sum of w Y
  float transmittance = 1;  ///< behind the last sample

  /// As the target's view shows it.
  [[nodiscard]] CNERF_HD float luminance_in(const RayTarget& target) const {
    return target.gain * luminance + transmittance * target.sky;
  }
  [[nodiscard]] CNERF_HD float over_background(const RayTarget& target) const {
    return luminance_in(target) + transmittance * target.background;
  }
};

/// How far a ray is from its pixel.
struct RayError {
  float seen = 0;       ///< linear Y with the background behind it
  float lightness = 0;  ///< (L*(seen) - L*(wanted)) / 100

  CNERF_HD RayError(const SeenRay& ray, const RayTarget& target)
      : seen(ray.over_background(target)),
        lightness((lightness_from_luminance(seen) - lightness_from_luminance(target.wanted())) / 100.0f) {}
};

/// What is asked of a ray's samples beside their light.
struct RayShape {
  Distortion<float> distortion;  ///< of the whole ray
  float depth_miss = 0;          ///< M: sum of w rho, plus the transmittance behind; 0 where no depth is known
};
struct ShapeWeights {
  float distortion = 0, depth = 0;
};

/// The loss of one ray.
[[nodiscard]] CNERF_HD inline float ray_loss(const RayError& error, const RayShape& shape,
                                             const ShapeWeights& weights) {
  return error.lightness * error.lightness + weights.distortion * shape.distortion.value +
         weights.depth * shape.depth_miss;
}

/// What PSNR is made of: on sRGB-encoded luminance over black, clamped to [0, 1].
[[nodiscard]] CNERF_HD inline float squared_error(const SeenRay& ray, const RayTarget& target) {
  const auto encoded = [](float y) { return srgb_from_linear(y < 0.0f ? 0.0f : y > 1.0f ? 1.0f : y); };
  const float error = encoded(ray.luminance_in(target)) - encoded(target.luminance);
  return error * error;
}

/// A sample of a ray as its gradient needs it.
struct LitSample {
  float dt = 0;                   ///< length of its interval; 1 for derivatives by optical depth instead of sigma
  float luminance = 0;            ///< Y it emits
  float weight = 0;               ///< w, its share of the pixel
  float transmittance_after = 0;  ///< T behind it
  float composited = 0;           ///< sum of w Y up to and including it
};

/// Derivatives of `scale` times a ray's loss by what its samples emit and absorb.
class RayGradient {
 public:
  /// @param gain   of the ray's view
  /// @param scale  of the loss: 1 / rays of the step
  CNERF_HD RayGradient(const RayError& error, float gain, const RayShape& shape, const ShapeWeights& weights,
                       float scale)
      : seen_(error.seen),
        gain_(gain),
        d_seen_(scale * 2.0f * error.lightness * lightness_derivative(seen_) / 100.0f),
        d_distortion_(scale * weights.distortion),
        d_depth_(scale * weights.depth),
        distortion_(shape.distortion) {}

  /// By the luminance that a sample emits.
  [[nodiscard]] CNERF_HD float by_luminance(const LitSample& sample) const { return d_seen_ * gain_ * sample.weight; }
  /// By the logarithm of the view's gain.
  [[nodiscard]] CNERF_HD float by_log_gain(const SeenRay& ray, const RayTarget& target) const {
    return d_seen_ * gain_ * ray.luminance + d_seen_ * ray.transmittance * target.sky;
  }
  /// By a sample's density, as far as it changes what is seen. What lies behind it counts, the background included.
  [[nodiscard]] CNERF_HD float by_density(const LitSample& sample) const {
    return d_seen_ * density_derivative(sample.dt, sample.transmittance_after, gain_ * sample.luminance,
                                        seen_ - gain_ * sample.composited);
  }

  /// The same of the distortion, which depends on densities through the weights w: dD/dw_i takes the place of the
  /// luminance, and what the samples behind i add is sum_{j>i} w_j dD/dw_j.
  [[nodiscard]] CNERF_HD float distortion_by_weight(float weight, const LogInterval<float>& at,
                                                    const Distortion<float>& before) const {
    return distortion_derivative(weight, at, before.weight, before.moment, distortion_);
  }
  /// sum_j w_j dD/dw_j over the whole ray: by Euler's theorem twice D, for D is homogeneous of degree 2 in w.
  [[nodiscard]] CNERF_HD float distortion_of_all() const { return 2.0f * distortion_.value; }
  /// @param slope   `distortion_by_weight` of the sample
  /// @param behind  sum_{j>i} w_j dD/dw_j
  [[nodiscard]] CNERF_HD float by_density_of_distortion(const LitSample& sample, float slope, float behind) const {
    return d_distortion_ * density_derivative(sample.dt, sample.transmittance_after, slope, behind);
  }
  /// And of the miss of a known depth, whose slope is rho.
  /// @param behind  sum_{j>i} w_j rho_j, plus the transmittance behind the last sample
  [[nodiscard]] CNERF_HD float by_density_of_depth(const LitSample& sample, float miss, float behind) const {
    return d_depth_ * density_derivative(sample.dt, sample.transmittance_after, miss, behind);
  }

 private:
  float seen_, gain_, d_seen_, d_distortion_, d_depth_;
  Distortion<float> distortion_;
};

}  // namespace cnerf
