#include "tests/capture/expectations.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "src/base/error.h"
#include "src/capture/load_capture.h"
#include "tests/capture/fixtures.h"

namespace cnerf::test {
namespace fs = std::filesystem;

void expect_same_pose(const Affined& found, const Affined& wanted) {
  EXPECT_LT(length(found.translation - wanted.translation), 1e-6 * std::max(1.0, length(wanted.translation)));
  for (int row = 0; row < 3; ++row) EXPECT_LT(length(found.linear.rows[row] - wanted.linear.rows[row]), 1e-6);
}

void expect_ring(const Capture& capture, int turned_by) {
  ASSERT_EQ(capture.views.size(), 4u);
  for (int i = 0; i < 4; ++i) {
    expect_same_pose(capture.views[std::size_t(i)].world_from_camera, ring_pose(i + turned_by, 4));
  }
}

void expect_same_lens(const Intrinsics& found, const Intrinsics& wanted) {
  EXPECT_EQ(found.model, wanted.model);
  EXPECT_EQ(found.width, wanted.width);
  EXPECT_EQ(found.height, wanted.height);
  EXPECT_NEAR(found.fx, wanted.fx, 1e-6 * wanted.fx);
  EXPECT_NEAR(found.fy, wanted.fy, 1e-6 * wanted.fy);
  EXPECT_NEAR(found.cx, wanted.cx, 1e-6 * wanted.width);
  EXPECT_NEAR(found.cy, wanted.cy, 1e-6 * wanted.width);
  for (std::size_t i = 0; i < 8; ++i) EXPECT_NEAR(found.distortion[i], wanted.distortion[i], 1e-9) << i;
}

void expect_input_error(const fs::path& capture, const std::vector<std::string>& parts) {
  try {
    (void)load_capture(capture);
    ADD_FAILURE() << "read without an error";
  } catch (const InputError& error) {
    for (const std::string& part : parts) EXPECT_THAT(error.what(), testing::HasSubstr(part));
  }
}

void expect_missing_image_left_out(const fs::path& capture, const fs::path& image) {
  ASSERT_TRUE(fs::remove(image)) << image;
  const Capture found = load_capture(capture);
  EXPECT_EQ(found.views.size(), 3u);
  EXPECT_THAT(found.notes, testing::Contains(testing::HasSubstr("1 of 4 listed images do not exist")));
}

}  // namespace cnerf::test
