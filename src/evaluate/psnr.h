#pragma once
/// Peak signal-to-noise ratios. Plain arithmetic: neither OpenCV nor Torch.

#include <cstdint>
#include <span>

namespace cnerf {

/// An sRGB-encoded value of linear light, clamped to [0, 1].
[[nodiscard]] float encoded_value(float linear);

/// Peak signal-to-noise ratio in dB of values whose peak is 1, from their mean squared error; capped at 100 dB, so that
/// equal pictures give a number that JSON can hold.
[[nodiscard]] double psnr_from_mse(double mean_squared_error);

/// Mean squared difference of sRGB-encoded values, each clamped to [0, 1] first.
/// @param ours, truth  linear light, equal sizes: [N] luminance or [N, 3] RGB, as `channels` says.
/// @param valid        [N]; pixels that count; empty = all.  NaN when none counts.
[[nodiscard]] double encoded_mse(std::span<const float> ours, std::span<const float> truth, int channels,
                                 std::span<const std::uint8_t> valid = {});

/// The gain of linear light that brings luminance closest to the truth, by least squares over the pixels that count.
[[nodiscard]] double fitted_gain(std::span<const float> ours, std::span<const float> truth,
                                 std::span<const std::uint8_t> valid = {});

}  // namespace cnerf
