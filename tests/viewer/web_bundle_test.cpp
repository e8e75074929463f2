#include "export/web_bundle.h"

#include <gtest/gtest.h>

#include <cstring>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/gzip.h"
#include "src/color/colorspace_math.h"
#include "tests/export/test_volumes.h"
#include "tests/support/data.h"
#include "tests/support/toy_capture.h"

namespace cnerf {
using namespace exporting;
namespace {
namespace fs = std::filesystem;
using exporting::test::make_web_photo;
using Json = nlohmann::json;

std::vector<std::uint8_t> unpacked(const std::vector<std::byte>& packed) {
  const auto bytes = gunzip(packed, std::size_t(1) << 24);
  EXPECT_TRUE(bytes);
  return bytes.value_or(std::vector<std::uint8_t>());
}

bake::Camera camera() {
  bake::Camera made{"images/a.png", {LensModel::kPinhole, 64, 48, 80, 80, 32, 24, {}}, {}};
  made.world_from_camera = {Mat3d::identity(), {1.1, 2.1, 1}};
  return made;
}

WebVolume shown(const bake::Volume& volume) {
  return {{make_web_bricks(volume)}, volume.frame, make_poster({&volume, 1}, camera(), 640)};
}

/// A fine block of 16^3 voxels, and a coarse one that goes on where it ends.
std::vector<bake::Volume> two_grids() {
  bake::Volume coarse = exporting::test::block_volume({0, 0, 0}, {16, 8, 8}, 5, 0.1);
  std::erase_if(coarse.voxels, [](const bake::Voxel& voxel) { return voxel.i < 8; });
  return {exporting::test::block_volume({0, 0, 0}, {16, 16, 16}, 9, 0.05), coarse};
}

struct Written {
  cnerf::test::TempDir folder;
  WebVolume volume = shown(exporting::test::block_volume({0, 0, 0}, {5, 5, 5}, 9));
  const WebBricks& bricks = volume.levels.front();
  WebReport report;
  Json json;

  explicit Written(const fs::path& page = {}) {
    const WebPhoto photo = make_web_photo(camera().intrinsics, std::vector<float>(64 * 48, 0.25f), 32, 80);
    report = write_web_bundle(volume, {"block", {camera()}, {photo}, exporting::test::label_of_first("y", "metres")},
                              folder.path(), page);
    json = Json::parse(read_text_file(report.manifest));
  }
};

TEST(WebBundle, ListsWhatItWroteWithChecksums) {
  const Written written;
  std::size_t listed = 0;
  for (const Json& file : written.json.at("files")) {
    const auto content = read_binary_file(written.folder / file.at("name").get<std::string>());
    EXPECT_EQ(content.size(), file.at("bytes").get<std::size_t>());
    EXPECT_EQ(sha256(content), file.at("sha256").get<std::string>());
    ++listed;
  }
  EXPECT_EQ(listed, 5u);  // three parts, poster, photograph
  EXPECT_EQ(unpacked(read_binary_file(written.folder / "occupancy.bin")), written.bricks.distance);
  std::vector<std::uint8_t> density = written.bricks.density;
  to_differences(density);
  EXPECT_EQ(unpacked(read_binary_file(written.folder / "density.bin")), density);
}

TEST(WebBundle, SaysFrameCamerasAndOriginOfTheColour) {
  const Json json = Written().json;
  EXPECT_EQ(json.at("up_axis"), "y");
  EXPECT_EQ(json.at("units"), "metres");
  EXPECT_EQ(json.at("color").at("colorizer"), "builtin");
  EXPECT_EQ(json.at("cameras").at(0).at("photo"), "photos/000.jpg");
  EXPECT_EQ(json.at("cameras").at(0).at("world_from_camera").at(2).at(3), 1.0);
  EXPECT_EQ(json.at("frame").at("world_centre").at(2), 3.5);
  ASSERT_EQ(json.at("levels").size(), 1u);
  EXPECT_NEAR(json.at("levels").at(0).at("voxel_size").get<double>(), 0.05, 1e-15);
}

TEST(WebBundle, HasALevelForEachGridCoarsestFirst) {
  const cnerf::test::TempDir folder;
  const WebScene scene{"two", {camera()}, {}, {}};
  Observer observer;
  write_web(two_grids(), scene, folder.path(), {}, {}, observer);
  const Json levels = Json::parse(read_text_file(folder / "bundle.json")).at("levels");
  ASSERT_EQ(levels.size(), 2u);
  EXPECT_NEAR(levels.at(0).at("voxel_size").get<double>(), 0.1, 1e-12);
  EXPECT_NEAR(levels.at(1).at("voxel_size").get<double>(), 0.05, 1e-12);
  EXPECT_NEAR(levels.at(1).at("cover").at("max").at(0).get<double>(), 1 + 8 * 0.1, 1e-12);
  for (const Json& level : levels) {
    const std::size_t voxels = level.at("stored_bricks").get<std::size_t>() * kWebBrickVoxels;
    const auto bytes_of = [&](const char* part) {
      return unpacked(read_binary_file(folder / level.at(part).at("file").get<std::string>())).size();
    };
    EXPECT_EQ(bytes_of("density"), voxels);
    EXPECT_EQ(bytes_of("color"), 3 * voxels);
  }
  EXPECT_TRUE(fs::exists(folder / "density_fine1.bin"));
  write_web({two_grids().front()}, scene, folder.path(), {}, {}, observer);
  EXPECT_FALSE(fs::exists(folder / "density_fine1.bin")) << "no part of another bundle stays";
}

TEST(WebBundle, HasNoPicturesOfAnother) {
  const cnerf::test::TempDir folder;
  WebScene scene{"two", {camera()}, {}, {}};
  Observer observer;
  scene.photos = {{.jpeg = std::vector<std::byte>(7)}};
  scene.sky = SkyPicture{2, 1, std::vector<float>(6, 0.5f)};
  write_web({two_grids().front()}, scene, folder.path(), {}, {}, observer);
  EXPECT_TRUE(fs::exists(folder / "photos" / "000.jpg"));
  write_file(folder / "photos" / "20240512.jpg", std::string_view("mine"));
  scene.photos = {};
  scene.sky = {};
  write_web({two_grids().front()}, scene, folder.path(), {}, {}, observer);
  EXPECT_FALSE(fs::exists(folder / "photos" / "000.jpg"));
  EXPECT_FALSE(fs::exists(folder / "sky.jpg"));
  EXPECT_TRUE(fs::exists(folder / "poster.webp"));
  EXPECT_TRUE(fs::exists(folder / "photos" / "20240512.jpg"));
}

TEST(WebBundle, PosterIsThePictureWithAlpha) {
  const Written written;
  const cv::Mat poster = cv::imread((written.folder / "poster.webp").string(), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(poster.channels(), 4);
  EXPECT_EQ(poster.cols, 64);
  const cv::Vec4b middle = poster.at<cv::Vec4b>(24, 32), corner = poster.at<cv::Vec4b>(0, 0);
  EXPECT_GT(middle[3], 150);  // 5 voxels of 0.45: 1 - exp(-2.25) = 0.89
  EXPECT_EQ(corner[3], 0);
  EXPECT_GT(middle[0], middle[2]);  // the block is blue
}

TEST(WebBundle, APhotographLosesItsDistortionAndKeepsItsTone) {
  Intrinsics lens{LensModel::kOpenCv, 200, 100, 150, 150, 100, 50, {-0.2, 0, 0, 0, 0, 0, 0, 0}};
  // A dot where the lens puts the direction (0.4, 0.2, 1).
  const auto seen = project(lens, {0.4, 0.2, 1});
  std::vector<float> luminance(200 * 100, 0.2f);
  for (int y = -2; y <= 2; ++y)
    for (int x = -2; x <= 2; ++x) {
      luminance[std::size_t((int(seen->y) + y) * 200 + int(seen->x) + x)] = 1.0f;
    }
  const WebPhoto photo = make_web_photo(lens, luminance, 200, 95);
  std::vector<std::uint8_t> bytes(photo.jpeg.size());
  std::memcpy(bytes.data(), photo.jpeg.data(), bytes.size());
  const cv::Mat grey = cv::imdecode(bytes, cv::IMREAD_GRAYSCALE);
  cv::Point brightest;
  cv::minMaxLoc(grey, nullptr, nullptr, nullptr, &brightest);
  EXPECT_NEAR(brightest.x, 100 + 0.4 * 150, 4);
  EXPECT_NEAR(brightest.y, 50 + 0.2 * 150, 4);
  EXPECT_NEAR(grey.at<std::uint8_t>(20, 40), 255 * srgb_from_linear(0.2f), 2);
  EXPECT_GT(std::abs(seen->x - (100 + 0.4 * 150)), 2) << "the lens must bend, or this shows nothing";
}

TEST(WebBundle, ViewsOfSeveralLensesAreEachShownByTheirOwn) {
  Capture capture = cnerf::test::toy_capture(5, 48, 40);
  for (const std::size_t v : {1, 3}) {
    capture.views[v].intrinsics.model = LensModel::kOpenCv;
    capture.views[v].intrinsics.distortion = {-0.1 * double(v), 0, 0, 0, 0, 0, 0, 0};
  }
  const std::vector<WebPhoto> photos = make_web_photos(capture.views, 40, 90);
  for (std::size_t v = 0; v < photos.size(); ++v) {
    const View& view = capture.views[v];
    EXPECT_EQ(photos[v].jpeg, make_web_photo(view.intrinsics, luminance_plane(view.image), 40, 90).jpeg) << v;
  }
}

TEST(WebBundle, CopiesThePage) {
  const cnerf::test::TempDir page;
  write_file(page / "index.html", std::string_view("<p>"));
  fs::create_directories(page / "assets");
  write_file(page / "assets" / "a.js", std::string_view("1;"));
  const Written written(page.path());
  EXPECT_EQ(read_text_file(written.folder / "index.html"), "<p>");
  EXPECT_EQ(read_text_file(written.folder / "assets" / "a.js"), "1;");
  EXPECT_EQ(written.report.page_bytes, 5u);
}

TEST(WebBundle, RefusesWhatDoesNotFit) {
  const cnerf::test::TempDir folder, empty;
  const WebVolume volume = shown(exporting::test::block_volume({0, 0, 0}, {2, 2, 2}, 9));
  EXPECT_THROW(write_web_bundle(volume, {"", {camera()}, {{}, {}}, {}}, folder.path(), {}), ContractError);
  EXPECT_THROW(write_web_bundle(volume, {"", {camera()}, {}, {}}, folder.path(), empty.path()), MissingInputError);
  EXPECT_FALSE(fs::exists(folder / "bundle.json")) << "the manifest comes last";
  EXPECT_THROW(write_web_bundle({}, {"", {camera()}, {}, {}}, folder.path(), {}), ContractError);
  EXPECT_THROW(write_web_bundle(volume, {"", {camera()}, {}, {}}, "/proc/nowhere", {}), OutputError);
}

}  // namespace
}  // namespace cnerf
