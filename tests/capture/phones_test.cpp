#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/capture/load_capture.h"
#include "tests/capture/expectations.h"
#include "tests/capture/fixtures.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::Contains;
using testing::HasSubstr;

// ---- Polycam --------------------------------------------------------------------------------------------------------

json polycam_camera(const Affined& pose) {
  json camera = {{"fx", 20.0},  {"fy", 21.0},   {"cx", 8.5},           {"cy", 5.5},
                 {"width", 16}, {"height", 12}, {"blur_score", 100.5}, {"timestamp", 1442008525605}};
  const json rows = test::opengl_matrix(pose);
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = 0; c < 4; ++c) camera["t_" + std::to_string(r) + std::to_string(c)] = rows[r][c];
  }
  return camera;
}

/// The four cameras of the ring in a pair of folders.
void write_polycam(const fs::path& root, const std::string& prefix, int turned_by = 0) {
  for (int i = 0; i < 4; ++i) {
    const std::string name = "144200852560" + std::to_string(i);
    test::write_grey_image(root / "keyframes" / (prefix + "images") / (name + ".jpg"), test::kWidth, test::kHeight, i);
    test::write_json(root / "keyframes" / (prefix + "cameras") / (name + ".json"),
                     polycam_camera(test::ring_pose(i + turned_by, 4)));
  }
}

TEST(Polycam, PosesAndLensesAreRead) {
  const test::TempDir folder;
  write_polycam(folder.path(), "");
  const Capture capture = load_capture(folder.path());
  EXPECT_EQ(capture.format, "polycam");
  test::expect_ring(capture);
  test::expect_same_lens(capture.views[0].intrinsics, {LensModel::kPinhole, 16, 12, 20, 21, 8.5, 5.5, {}});
  EXPECT_EQ(capture.views[0].image_file, folder / "keyframes/images/1442008525600.jpg");
}

TEST(Polycam, CorrectedCamerasComeFirst) {
  const test::TempDir folder;
  write_polycam(folder.path(), "");
  write_polycam(folder.path(), "corrected_", 1);
  const Capture capture = load_capture(folder.path());
  test::expect_ring(capture, 1);
  EXPECT_EQ(capture.views[0].image_file, folder / "keyframes/corrected_images/1442008525600.jpg");
}

TEST(Polycam, MissingImagesAreLeftOut) {
  const test::TempDir folder;
  write_polycam(folder.path(), "");
  test::expect_missing_image_left_out(folder.path(), folder / "keyframes/images/1442008525601.jpg");
}

TEST(Polycam, BadCamerasAreRefused) {
  const test::TempDir folder;
  write_polycam(folder.path(), "");
  const auto refuse = [&](const std::string& key, const json& value, const std::vector<std::string>& says) {
    json camera = polycam_camera(test::ring_pose(0, 4));
    camera[key] = value;
    if (value.is_null()) camera.erase(key);
    test::write_json(folder / "keyframes/cameras/1442008525600.json", camera);
    test::expect_input_error(folder.path(), says);
  };
  refuse("fx", nullptr, {"1442008525600.json", "fx", "is missing"});
  refuse("t_12", "up", {"1442008525600.json", "t_12", "up"});
  refuse("t_00", 5, {"1442008525600.json", "t_00 to t_22", "expected a rotation"});
  refuse("t_03", 1e300, {"1442008525600.json", "position", "1e+300"});
  refuse("width", 16.5, {"1442008525600.json", "width", "expected a size in pixels, found 16.5"});
  refuse("fy", 0, {"1442008525600.json", "fy", "above 0, found 0"});
  refuse("fx", 1e6, {"1442008525600.json", "focal length", "found 1e+06"});
}

// ---- Record3D -------------------------------------------------------------------------------------------------------

/// metadata.json and images of the four cameras of the ring.
json write_record3d(const fs::path& folder, const std::string& images = "rgb") {
  json metadata = {{"w", 16}, {"h", 12}, {"fps", 60}, {"K", {20, 0, 0, 0, 21, 0, 8.5, 5.5, 1}}};
  for (int i = 0; i < 4; ++i) {
    test::write_grey_image(folder / images / (std::to_string(i) + ".jpg"), test::kWidth, test::kHeight, i);
    const Affined pose = test::ring_pose(i, 4);
    // The camera of OpenGL has its Y and Z turned over.
    const Mat3d m = Mat3d::from_columns(pose.linear.column(0), -pose.linear.column(1), -pose.linear.column(2));
    const auto [w, x, y, z] = test::quaternion_of(m);
    const Vec3d p = pose.translation;
    metadata["poses"].push_back({x, y, z, w, p.x, p.y, p.z});
  }
  test::write_json(folder / "metadata.json", metadata);
  return metadata;
}

TEST(Record3d, PosesAndLensAreRead) {
  const test::TempDir folder;
  (void)write_record3d(folder.path());
  for (const fs::path& path : {folder.path(), folder / "metadata.json"}) {
    const Capture capture = load_capture(path);
    EXPECT_EQ(capture.format, "record3d");
    test::expect_ring(capture);
    test::expect_same_lens(capture.views[0].intrinsics, {LensModel::kPinhole, 16, 12, 20, 21, 8.5, 5.5, {}});
  }
}

TEST(Record3d, EachPictureMayHaveItsLens) {
  const test::TempDir folder;
  json metadata = write_record3d(folder / "EXR_RGBD", "rgbd");
  metadata["perFrameIntrinsicCoeffs"] = {{20, 21, 8, 6}, {22, 23, 7, 5}, {24, 25, 6, 4}, {26, 27, 5, 3}};
  test::write_json(folder / "EXR_RGBD/metadata.json", metadata);
  const Capture capture = load_capture(folder.path());
  test::expect_ring(capture);
  test::expect_same_lens(capture.views[2].intrinsics, {LensModel::kPinhole, 16, 12, 24, 25, 6, 4, {}});
}

/// ARKit's camera looks along -Z, with +Y to the top of the picture.
TEST(Record3d, APointBeforeAnUnturnedCameraIsSeen) {
  const test::TempDir folder;
  json metadata = write_record3d(folder.path());
  metadata["poses"][0] = {0, 0, 0, 1, 10, 20, 30};
  test::write_json(folder / "metadata.json", metadata);
  const View view = load_capture(folder.path()).views[0];
  const auto pixel = project(view.intrinsics, view.world_from_camera.inverse().point({10.5, 20.25, 28}));
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->x, 8.5 + 20 * 0.5 / 2, 1e-9);
  EXPECT_NEAR(pixel->y, 5.5 - 21 * 0.25 / 2, 1e-9);
}

TEST(Record3d, MissingImagesAreLeftOut) {
  const test::TempDir folder;
  (void)write_record3d(folder.path());
  fs::remove(folder / "rgb/1.jpg");
  const Capture capture = load_capture(folder.path());
  EXPECT_EQ(capture.views.size(), 3u);
  EXPECT_THAT(capture.notes,
              Contains(HasSubstr("1 of 4 listed images do not exist and were skipped, the first: 1.jpg")));
}

TEST(Record3d, AnotherMetadataJsonIsNoCapture) {
  const test::TempDir folder;
  (void)write_record3d(folder.path());
  fs::rename(folder / "rgb", folder / "pictures");
  EXPECT_FALSE(holds_poses(folder.path()));
}

TEST(Record3d, BadMetadataIsRefused) {
  const test::TempDir folder;
  const json good = write_record3d(folder.path());
  const auto refuse = [&](const std::function<void(json&)>& spoil, const std::vector<std::string>& says) {
    json metadata = good;
    spoil(metadata);
    test::write_json(folder / "metadata.json", metadata);
    test::expect_input_error(folder.path(), says);
  };
  refuse([](json& m) { m.erase("K"); }, {"metadata.json", "K", "is missing"});
  refuse([](json& m) { m["K"] = {1, 2}; }, {"metadata.json", "K", "expected 9 values"});
  refuse([](json& m) { m["poses"][2] = {0, 0, 0, 1}; }, {"poses[2]", "expected 7 values"});
  refuse([](json& m) { m["poses"][2][3] = "w"; }, {"poses[2][3]", "w"});
  refuse([](json& m) { m["poses"][2][3] = 7; }, {"poses[2]", "expected a unit quaternion"});
  refuse(
      [](json& m) {
        m["perFrameIntrinsicCoeffs"] = {{20, 21, 8, 6}};
      },
      {"perFrameIntrinsicCoeffs", "each of the 4 poses, found 1"});
  refuse([](json& m) { m["K"][4] = 0; }, {"metadata.json", "K", "above 0, found 0"});
  refuse([](json& m) { m["h"] = 0; }, {"metadata.json", "h", "expected a size in pixels, found 0"});
}

TEST(OtherFormats, AnEmptyFolderNamesWhatWasLookedFor) {
  const test::TempDir folder;
  try {
    (void)load_capture(folder.path());
    FAIL() << "there are no poses";
  } catch (const MissingInputError& error) {
    for (const char* marker : {"cameras.xml", "*.csv", "*.xmp", "keyframes/", "metadata.json"}) {
      EXPECT_THAT(error.what(), HasSubstr(marker));
    }
  }
}

}  // namespace
}  // namespace cnerf
