#include "src/prepare/spike_stream.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/rng.h"
#include "src/color/colorspace_math.h"
#include "tests/support/data.h"

namespace cnerf::prepare {
namespace {

/// What a spike camera makes of constant light: it gathers, fires when full, and keeps the rest.
std::vector<std::byte> stream_of(const std::vector<double>& light, int ticks) {
  SequentialRng rng(1, 0);
  const std::size_t stride = (light.size() + 7) / 8;
  std::vector<std::byte> out(stride * std::size_t(ticks));
  for (std::size_t pixel = 0; pixel < light.size(); ++pixel) {
    double gathered = rng.uniform();
    for (int tick = 0; tick < ticks; ++tick) {
      gathered += light[pixel];
      if (gathered < 1) continue;
      gathered -= 1;
      out[std::size_t(tick) * stride + pixel / 8] |= std::byte(1u << (pixel % 8));
    }
  }
  return out;
}

std::vector<double> ramp_of_light(int pixels) {
  std::vector<double> light;
  for (int i = 0; i < pixels; ++i) light.push_back(0.02 + 0.96 * i / pixels);
  return light;
}

TEST(Spikes, RateIsTheLight) {
  const std::vector<double> light = ramp_of_light(13 * 7);  // no multiple of 8
  const LinearImage picture = integrate_spikes(stream_of(light, 256), 13, 7, 256);
  for (std::size_t i = 0; i < light.size(); ++i) {
    // n intervals are whole within one tick of 256; near-dark pixels have few intervals.
    EXPECT_NEAR(picture.values[i], light[i], 2.0 * light[i] / (256 * 0.7)) << i;
  }
}

TEST(Spikes, DarkPixelsStayDark) {
  const std::vector<double> light(16, 0.0);
  for (const float value : integrate_spikes(stream_of(light, 64), 4, 4, 64).values) EXPECT_EQ(value, 0);
}

TEST(Spikes, AStreamBecomesPictures) {
  const test::TempDir folder;
  const std::vector<double> light = ramp_of_light(16 * 8);
  const std::vector<std::byte> bytes = stream_of(light, 400);
  write_file(folder / "s.dat", bytes);
  SpikeOptions options;
  EXPECT_THROW((void)import_spikes(folder / "s.dat", folder / "out", options, 4, {}), UsageError);
  options.spike_width = 16;
  options.spike_height = 7;
  EXPECT_THROW((void)import_spikes(folder / "s.dat", folder / "out", options, 4, {}), InputError);
  options.spike_height = 8;
  const PhotographSet set = import_spikes(folder / "s.dat", folder / "out", options, 4, {});
  ASSERT_EQ(set.images.size(), 4u);
  const cv::Mat1w first = cv::imread((folder / "out" / "images" / set.images[0].name).string(), cv::IMREAD_UNCHANGED);
  double squared = 0;
  for (int i = 0; i < 128; ++i) {
    const double off = linear_from_srgb(first(i / 16, i % 16) / 65535.0) - light[std::size_t(i)];
    squared += off * off / 128;
  }
  EXPECT_LT(std::sqrt(squared), 0.02);  // 64 ticks
  options.spike_flip = true;
  const PhotographSet flipped = import_spikes(folder / "s.dat", folder / "flipped", options, 4, {});
  const cv::Mat1w other =
      cv::imread((folder / "flipped" / "images" / flipped.images[0].name).string(), cv::IMREAD_UNCHANGED);
  EXPECT_EQ(other(7, 3), first(0, 3));
}

}  // namespace
}  // namespace cnerf::prepare
