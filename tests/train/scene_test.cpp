// Rendered views of a coloured scene, with a finish and without.

#include "src/train/scene.h"

#include "src/train/luminance/luminance_model.h"
#include "tests/support/stage2_fixture.h"

namespace cnerf {
namespace {

class FinishedScene : public test::Stage2Fixture {
 protected:
  void SetUp() override {
    Stage2Fixture::SetUp();
    LuminanceModel luminance = LuminanceModel::load(stage1(), cpu_engines());
    luminance.sky = {8, 4, {std::vector<float>(std::size_t(8) * 4, 0.25f)}};
    luminance.save(stage1());
    Stage2Options options = small_options();
    options.distill_steps = 2;
    test::Listening colorizer;
    (void)colorize(options, colorizer, take("a"));
  }
  /// @param is_given  whether the light of samples is asked for, as that of a view average is
  [[nodiscard]] RenderedImage seen(const Finish& finish, bool is_given) const {
    const auto scene = Scene::load(stage1(), take("a"), finish, cpu_engines());
    RenderOptions options;
    options.baked_color = true;
    if (is_given) {
      options.luminance = [&](std::span<const Vec3f> positions, std::span<float> luminance) {
        scene->query_luminance(positions, std::vector<Vec3f>(positions.size(), Vec3f{1, 0, 0}), luminance);
      };
    }
    const View& view = capture_.views.back();
    return scene->render(view.intrinsics, view.world_from_camera, options);
  }
};

int count_of_colored(const RenderedImage& image) {
  int count = 0;
  for (std::size_t i = 0; i + 1 < image.rgb.size(); i += 3) {
    if (std::abs(image.rgb[i] - image.rgb[i + 1]) > 0.02f) ++count;
  }
  return count;
}

void expect_doubled(const std::vector<float>& once, const std::vector<float>& twice) {
  ASSERT_EQ(once.size(), twice.size());
  for (std::size_t i = 0; i < once.size(); ++i) ASSERT_FLOAT_EQ(twice[i], 2 * once[i]) << i;
}

TEST_F(FinishedScene, ExposureMultipliesLight) {
  for (Finish finish : {Finish{}, Finish{.saturation = 1.5, .hue = 20}}) {
    for (const bool is_given : {false, true}) {
      finish.exposure = 0;
      const RenderedImage plain = seen(finish, is_given);
      finish.exposure = 1;
      const RenderedImage exposed = seen(finish, is_given);
      EXPECT_GT(count_of_colored(plain), 50);
      expect_doubled(plain.luminance, exposed.luminance);
      expect_doubled(plain.rgb, exposed.rgb);
      expect_doubled(plain.baked_rgb, exposed.baked_rgb);
      EXPECT_EQ(plain.opacity, exposed.opacity);
      EXPECT_EQ(plain.depth, exposed.depth);
    }
  }
}

}  // namespace
}  // namespace cnerf
