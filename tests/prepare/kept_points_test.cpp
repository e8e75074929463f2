/// Points of a ready model reach the prepared capture, in whichever form COLMAP wrote them.

#include <gtest/gtest.h>

#include "src/capture/load_capture.h"
#include "src/prepare/prepare.h"
#include "tests/capture/fixtures.h"
#include "tests/support/data.h"

namespace cnerf::prepare {
namespace {

class KeptPoints : public testing::Test {
 protected:
  void SetUp() override {
    test::write_colmap_images(folder_ / "photos");
    options_.colmap_model = (folder_ / "model").string();
  }
  [[nodiscard]] Capture prepared() {
    prepare_capture(folder_ / "photos", folder_ / "capture", options_, {}, [](const std::string&) {});
    return load_capture(folder_ / "capture");
  }
  void expect_points_of_the_model() {
    const Capture before = load_capture(folder_ / "model"), after = prepared();
    ASSERT_EQ(before.points.size(), 2u);
    ASSERT_EQ(after.points.size(), 2u);
    for (std::size_t p = 0; p < 2; ++p) {
      EXPECT_EQ(after.points[p].error, before.points[p].error);
      EXPECT_EQ(after.points[p].views, before.points[p].views);
      for (std::size_t v = 0; v < before.views.size(); ++v) {
        const auto there = after.views[v].world_from_camera.inverse().point(after.points[p].position);
        const auto here = before.views[v].world_from_camera.inverse().point(before.points[p].position);
        EXPECT_LT(length(normalized(there) - normalized(here)), 1e-7) << "seen in the same place";
      }
    }
  }

  test::TempDir folder_;
  PrepareOptions options_;
};

TEST_F(KeptPoints, OfABinaryModelWithRigs) {
  test::write_colmap_binary(folder_ / "model");
  test::write_colmap_rigs_binary(folder_ / "model");
  test::write_colmap_images(folder_ / "model/images");
  expect_points_of_the_model();
}

TEST_F(KeptPoints, OfATextModelWithRigs) {
  test::write_colmap_text(folder_ / "model");
  test::write_colmap_rigs_text(folder_ / "model");
  test::write_colmap_images(folder_ / "model/images");
  expect_points_of_the_model();
}

TEST_F(KeptPoints, AModelWithoutPointsMakesACaptureWithoutThem) {
  test::write_colmap_text(folder_ / "model");
  std::filesystem::remove(folder_ / "model/points3D.txt");
  EXPECT_TRUE(prepared().points.empty());
  EXPECT_FALSE(std::filesystem::exists(folder_ / "capture/points3D.txt"));
}

}  // namespace
}  // namespace cnerf::prepare
