// Frames of a field: those that are traced in part look like whole ones, and all may be stopped.

#include "src/studio/field_view.h"

#include <cmath>
#include <cstdlib>

#include "tests/support/stage2_fixture.h"

namespace cnerf::studio {
namespace {

/// Answers two colours, one for what is dark.
class ByLightness final : public Colorizer {
 public:
  ChromaBatch colorize(const LightnessBatch& patches) override {
    const std::size_t pixels = patches.lightness.size() / std::size_t(patches.batch);
    ChromaBatch answer{patches.batch, patches.height, patches.width, {}, {}};
    for (std::size_t i = 0; i < std::size_t(patches.batch); ++i) {
      const auto patch = std::span(patches.lightness).subspan(i * pixels, pixels);
      for (const float lightness : patch) answer.ab.push_back(lightness > 50 ? 40.0f : 5.0f);
      for (const float lightness : patch) answer.ab.push_back(lightness > 50 ? 30.0f : -30.0f);
    }
    return answer;
  }
  [[nodiscard]] std::string name() const override { return "by lightness"; }
};

constexpr auto kNever = std::size_t(-1);

double decibel(const Picture& a, const Picture& b) {
  EXPECT_EQ(a.rgb.size(), b.rgb.size());
  double sum = 0;
  for (std::size_t i = 0; i < a.rgb.size(); ++i) sum += std::pow(double(a.rgb[i]) - b.rgb[i], 2);
  return 10 * std::log10(255.0 * 255.0 / std::max(sum / double(a.rgb.size()), 1e-9));
}

class FieldView : public test::Stage2Fixture {
 protected:
  void SetUp() override {
    Stage2Fixture::SetUp();
    static const std::vector<std::byte> colored = colored_take();  // the same for all tests of a process
    write_file(take("two"), colored);
    luminance_ = LuminanceModel::load(stage1(), cpu_engines());
    colors_ = ColorModel::load(take("two"), cpu_engines());
  }
  std::vector<std::byte> colored_take() {
    ByLightness colorizer;
    (void)colorize(small_options(), colorizer, take("colored"));
    return read_binary_file(take("colored"));
  }
  [[nodiscard]] FieldCamera camera(int view, int enlarged = 2) const {
    FieldCamera camera{capture_.views[std::size_t(view)].intrinsics,
                       capture_.views[std::size_t(view)].world_from_camera};
    Intrinsics& lens = camera.lens;
    for (double* number : {&lens.fx, &lens.fy, &lens.cx, &lens.cy}) *number *= enlarged;
    lens.width *= enlarged;
    lens.height *= enlarged;
    return camera;
  }
  [[nodiscard]] std::vector<Picture> draw(const FieldCamera& camera, std::size_t least_sparse_pixels,
                                          DrawingCosts& costs) const {
    DrawingEffort effort = sharp_effort(64);
    effort.least_sparse_pixels = least_sparse_pixels;
    const std::vector<Side> sides = {&colors_, nullptr, &colors_};
    return draw_field(
        luminance_, camera, sides, effort, [] { return true; }, &costs);
  }

  LuminanceModel luminance_;
  ColorModel colors_;
};

TEST_F(FieldView, SparseFramesLookLikeWholeOnes) {
  for (const int view : {0, 5}) {
    DrawingCosts of_whole, of_sparse;
    const std::vector<Picture> whole = draw(camera(view, 4), kNever, of_whole),
                               sparse = draw(camera(view, 4), 1, of_sparse);
    ASSERT_EQ(whole.size(), 3u);
    ASSERT_EQ(sparse.size(), 3u);
    EXPECT_EQ(of_whole.rays, whole[0].rgb.size() / 3);
    EXPECT_EQ(of_whole.colored_rays, of_whole.rays);
    EXPECT_LT(double(of_sparse.rays), 0.6 * double(of_whole.rays));
    EXPECT_LT(double(of_sparse.colored_rays), 0.25 * double(of_whole.rays));
    EXPECT_GT(decibel(sparse[0], whole[0]), 43);
    EXPECT_GT(decibel(sparse[1], whole[1]), 43);
    EXPECT_EQ(sparse[0].rgb, sparse[2].rgb) << "of the same side";
    EXPECT_GT(decibel(whole[0], whole[1]), 5) << "something is there";
    EXPECT_LT(decibel(whole[0], whole[1]), 40) << "in colour";
  }
}

TEST_F(FieldView, SmallFramesAreTracedWhole) {
  const FieldCamera small = camera(1);
  const std::size_t count = std::size_t(small.lens.width) * std::size_t(small.lens.height);
  DrawingCosts never, below, at;
  const std::vector<Picture> whole = draw(small, 0, never);
  EXPECT_EQ(draw(small, count + 1, below)[0].rgb, whole[0].rgb);
  (void)draw(small, count, at);
  EXPECT_EQ(below.rays, count);
  EXPECT_LT(at.rays, count);
}

TEST_F(FieldView, ExposureMultipliesLight) {
  const auto drawn = [&](double exposure) {
    const DrawingEffort effort = sharp_effort(64, {.exposure = exposure});
    const std::vector<Side> sides = {&colors_};
    return draw_field(luminance_, camera(0), sides, effort, [] { return true; }).front();
  };
  const Picture plain = drawn(0), darker = drawn(-1);
  int worst = 0;
  for (std::size_t i = 0; i < plain.rgb.size(); ++i) {
    if (plain.rgb[i] == 255) continue;  // perhaps clipped
    const float half = 0.5f * linear_from_srgb(float(plain.rgb[i]) / 255);
    worst = std::max(worst, std::abs(int(darker.rgb[i]) - int(srgb8_from_linear(half))));
  }
  EXPECT_LE(worst, 1) << "both pictures are rounded";
}

TEST_F(FieldView, DrawingStopsBetweenParts) {
  const std::vector<Side> sides = {nullptr, &colors_};
  DrawingEffort effort = sharp_effort(64);
  effort.least_sparse_pixels = 1;
  int parts = 0;
  (void)draw_field(luminance_, camera(0), sides, effort, [&] { return ++parts > 0; });
  ASSERT_GE(parts, 4) << "of each pass one, at least";
  for (int last = 0; last < parts; ++last) {
    int asked = 0;
    EXPECT_TRUE(draw_field(luminance_, camera(0), sides, effort, [&] { return asked++ < last; }).empty());
    EXPECT_EQ(asked, last + 1);
  }
}

}  // namespace
}  // namespace cnerf::studio
