// Which pixels the rays of a training step show.

#include "src/render/observed_ray.h"

#include <gtest/gtest.h>

#include "tests/support/toy_capture.h"

namespace cnerf {
namespace {

TEST(ObservedRay, ShowsNoPixelThatIsMaskedOutHoweverFewAreLeft) {
  Capture capture = test::toy_capture(2, 40, 40);
  for (View& view : capture.views) {
    view.image.mask.assign(view.image.pixel_count(), 0);
    for (int x = 8; x < 16; ++x) view.image.mask[40 * 20 + std::size_t(x)] = 255;  // one pixel of 200
  }
  const SceneFrame frame;
  const std::vector<TrainingView> views = training_views(capture, frame);
  for (std::uint64_t ray = 0; ray < 500; ++ray) {
    const ObservedRay observed = observe_ray(views, 1, 3, ray);
    const UnitCamera& camera = views[observed.view].camera;
    const auto at =
        project(camera.intrinsics, camera.unit_from_camera.transposed() * observed.ray.direction.cast<double>());
    ASSERT_TRUE(at);
    const std::size_t pixel = std::size_t(at->y) * 40 + std::size_t(at->x);
    EXPECT_TRUE(views[observed.view].image->valid(pixel)) << ray;
  }
}

}  // namespace
}  // namespace cnerf
