/// cnerf prepare as a program: what it makes, what it refuses, what it leaves.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "src/base/files.h"
#include "src/capture/load_capture.h"
#include "src/prepare/similarity.h"
#include "tests/e2e/program.h"
#include "tests/support/data.h"
#include "tests/support/no_programs.h"
#include "tests/support/pose_comparison.h"

namespace cnerf::test {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;

/// w x y z of a rotation, by the largest of the four, so that none is lost to rounding.
std::array<double, 4> quaternion_of(const Mat3d& m) {
  const auto at = [&](int r, int c) { return m.rows[r][c]; };
  const std::array<double, 4> squares = {1 + at(0, 0) + at(1, 1) + at(2, 2), 1 + at(0, 0) - at(1, 1) - at(2, 2),
                                         1 - at(0, 0) + at(1, 1) - at(2, 2), 1 - at(0, 0) - at(1, 1) + at(2, 2)};
  const double wx = at(2, 1) - at(1, 2), wy = at(0, 2) - at(2, 0), wz = at(1, 0) - at(0, 1);
  const double xy = at(0, 1) + at(1, 0), xz = at(0, 2) + at(2, 0), yz = at(1, 2) + at(2, 1);
  const double products[4][4] = {
      {squares[0], wx, wy, wz}, {wx, squares[1], xy, xz}, {wy, xy, squares[2], yz}, {wz, xz, yz, squares[3]}};
  const auto largest = std::size_t(std::ranges::max_element(squares) - squares.begin());
  const double scale = 0.5 / std::sqrt(squares[largest]);
  return {products[largest][0] * scale, products[largest][1] * scale, products[largest][2] * scale,
          products[largest][3] * scale};
}

/// The tiny capture as a user has it: photographs, and somebody's COLMAP model.
struct UserFolder {
  fs::path photos, model;
};
UserFolder without_poses(const fs::path& folder) {
  const UserFolder out = {folder / "photos", folder / "model"};
  fs::create_directories(out.photos);
  const Capture capture = load_capture(tiny_capture());
  std::ostringstream cameras, images;
  cameras.precision(17), images.precision(17);
  int number = 0;
  for (const View& view : capture.views) {
    fs::copy_file(view.image_file, out.photos / view.image_file.filename());
    const Affined camera_from_world = view.world_from_camera.inverse();
    ++number;
    images << number;
    for (const double q : quaternion_of(camera_from_world.linear)) images << ' ' << q;
    for (int axis = 0; axis < 3; ++axis) images << ' ' << camera_from_world.translation[axis];
    images << " 1 " << view.image_file.filename().string() << "\n\n";
  }
  const Intrinsics& lens = capture.views.front().intrinsics;
  cameras << "1 PINHOLE " << lens.width << ' ' << lens.height << ' ' << lens.fx << ' ' << lens.fy << ' ' << lens.cx
          << ' ' << lens.cy << '\n';
  write_file(out.model / "cameras.txt", cameras.str());
  write_file(out.model / "images.txt", images.str());
  write_file(out.model / "points3D.txt", std::string_view("1 0 0 0 9 9 9 0.1 1 0 3 7\n2 0.1 0 0.2 9 9 9 0.1\n"));
  return out;
}

/// Leaves a model its first images.
void shorten_model(const fs::path& model, int images) {
  std::istringstream lines(read_text_file(model / "images.txt"));
  std::string kept, line;
  for (int i = 0; i < 2 * images && std::getline(lines, line); ++i) kept += line + "\n";
  write_file(model / "images.txt", kept);
}

TEST(Prepare, TakesAReadyModelAndSetsItUpright) {
  const TempDir folder;
  const UserFolder user = without_poses(folder.path());
  const fs::path out = folder / "capture";
  const ProgramResult result =
      cnerf({"prepare", user.photos.string(), "-o", out.string(), "--colmap-model", user.model.string()});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("exposures: taken as equal")) << "the model's images name no points";
  for (const char* file : {"transforms.json", "prepare.json", "contact_sheet.png"}) EXPECT_TRUE(fs::exists(out / file));
  std::vector<Affined> poses, truth;
  const Capture given = load_capture(tiny_capture()), prepared = load_capture(out);
  ASSERT_EQ(prepared.views.size(), given.views.size());
  for (std::size_t i = 0; i < given.views.size(); ++i) {
    poses.push_back(prepared.views[i].world_from_camera);
    truth.push_back(given.views[i].world_from_camera);
    EXPECT_EQ(prepared.views[i].image.u8, given.views[i].image.u8);
  }
  const test::PoseComparison comparison = test::compare_poses(poses, truth);
  for (const double degrees : comparison.rotation_degrees) EXPECT_LT(degrees, 1e-6);
  for (const double error : comparison.centre_errors) EXPECT_LT(error, 1e-9);
  // The sample's cameras are level about Z, so Z stays up.
  EXPECT_LT(length(comparison.truth_from_poses.rotation * Vec3d{0, 0, 1} - Vec3d{0, 0, 1}), 1e-6);

  ASSERT_EQ(prepared.points.size(), 2u) << "the model's points are kept";
  EXPECT_EQ(prepared.points[0].views, (std::vector<std::uint32_t>{0, 2}));
  EXPECT_DOUBLE_EQ(prepared.points[0].error, 0.1);
  const auto pixel_in = [](const View& view, Vec3d point) {
    return project(view.intrinsics, view.world_from_camera.inverse().point(point)).value();
  };
  const PixelPosition there = pixel_in(prepared.views[2], prepared.points[1].position);
  const PixelPosition here = pixel_in(given.views[2], {0.1, 0, 0.2});
  EXPECT_NEAR(there.x, here.x, 1e-4) << "in the frame of the prepared poses";
  EXPECT_NEAR(there.y, here.y, 1e-4);

  const auto record = nlohmann::json::parse(read_text_file(out / "prepare.json"));
  EXPECT_EQ(record.at("poses").at("placed"), given.views.size());
  EXPECT_EQ(record.at("frame").at("unit"), "unknown");

  EXPECT_EQ(cnerf({"prepare", user.photos.string(), "-o", out.string()}).exit_code, 64) << "it is there already";
  EXPECT_EQ(cnerf({"prepare", user.photos.string(), "-o", out.string(), "--resume"}).exit_code, 0);
  EXPECT_EQ(cnerf({"prepare", user.model.string(), "-o", out.string(), "--resume"}).exit_code, 64) << "another source";
}

TEST(Prepare, NamesPhotographsThatAReadyModelDoesNotHold) {
  const TempDir folder;
  const UserFolder user = without_poses(folder.path());
  const std::string last = load_capture(tiny_capture()).views.back().image_file.stem().string();
  const auto prepared = [&](int images) {
    shorten_model(user.model, images);
    return cnerf({"prepare", user.photos.string(), "-o", (folder / "capture").string(), "--overwrite", "--colmap-model",
                  user.model.string()});
  };
  const ProgramResult most = prepared(8);
  EXPECT_EQ(most.exit_code, 0) << most.err;
  EXPECT_THAT(most.out,
              testing::AllOf(HasSubstr("poses: 8 of 9 images placed"), HasSubstr("not placed: " + last + ".png")));
  const ProgramResult few = prepared(2);
  EXPECT_EQ(few.exit_code, 77);
  EXPECT_THAT(few.err, HasSubstr("poses: 2 of 9 images placed"));
}

TEST(Prepare, RefusesAReadyModelThatItCannotUse) {
  const TempDir folder;
  const UserFolder user = without_poses(folder.path());
  const auto refused = [&](const std::vector<std::string>& more, int code, const std::string& message) {
    const std::vector<std::string> words = {
        "prepare",        user.photos.string(), "-o", (folder / "capture").string(), "--overwrite",
        "--colmap-model", user.model.string()};
    const ProgramResult result = cnerf(concatenated(words, more));
    EXPECT_EQ(result.exit_code, code) << result.err;
    EXPECT_THAT(result.err, HasSubstr(message));
  };
  refused({"--haze"}, 65, "by which --haze is found");
  refused({"--haze", "--no-exposure"}, 64, "haze, no_exposure");
  const std::string name = load_capture(tiny_capture()).views.front().image_file.filename().string();
  write_file(user.model / "images.txt",
             read_text_file(user.model / "images.txt") + "99 1 0 0 0 0 0 0 1 left/" + name + "\n\n");
  refused({}, 65, "left/" + name + ": is of the same photograph as image " + name);
}

TEST(Prepare, LevelsThatAFileCannotHaveAreRefused) {
  const TempDir folder;
  const UserFolder user = without_poses(folder.path());
  const auto refused = [&](const std::vector<std::string>& levels, const std::string& message) {
    const std::vector<std::string> words = {"prepare", user.photos.string(), "-o", (folder / "capture").string(),
                                            "--overwrite"};
    const ProgramResult result = cnerf(concatenated(words, levels));
    EXPECT_EQ(result.exit_code, 64) << result.err;
    EXPECT_THAT(result.err, HasSubstr(message));
  };
  refused({"--white-level", "4095"}, "white_level: expected at most 255");
  refused({"--black-level", "4000", "--white-level", "4095"}, "white_level: expected at most 255");
  refused({"--black-level", "255"}, "black_level: expected less than 255");
  refused({"--black-level", "200", "--white-level", "100"}, "black_level: expected less than white_level, 100");
}

/// What a run prepares is sRGB-encoded, whatever it was made of.
TEST(Prepare, ARunReadsTheCaptureOfLinearPhotographsAsItIsStored) {
  const TempDir folder;
  const UserFolder user = without_poses(folder.path());
  const std::string run = (folder / "run").string();
  const ProgramResult prepared = cnerf({"prepare", user.photos.string(), "-o", run + "-capture", "--transfer", "linear",
                                        "--colmap-model", user.model.string()});
  ASSERT_EQ(prepared.exit_code, 0) << prepared.err;
  const ProgramResult result =
      cnerf(concatenated({"run", user.photos.string(), "-o", run, "--grey", "--transfer", "linear"}, tiny_options()));
  EXPECT_THAT(read_text_file(run + "/config.toml"), testing::ContainsRegex("transfer = .srgb.")) << result.err;
}

TEST(Prepare, LooksForMotionAlsoAfterwards) {
  const TempDir folder;
  const UserFolder user = without_poses(folder.path());
  const fs::path out = folder / "capture";
  const fs::path disturbed = user.photos / load_capture(tiny_capture()).views.front().image_file.filename();
  cv::Mat picture = cv::imread(disturbed.string(), cv::IMREAD_UNCHANGED);
  picture(cv::Rect(picture.cols / 3, picture.rows / 3, picture.cols / 3, picture.rows / 3)) = cv::Scalar::all(255);
  cv::imwrite(disturbed.string(), picture);
  std::vector<std::string> words = {"prepare",    user.photos.string(), "-o",
                                    out.string(), "--colmap-model",     user.model.string()};
  ASSERT_EQ(cnerf(words).exit_code, 0);
  words.insert(words.end(), {"--resume", "--motion-masks", "--motion-steps", "50"});
  const ProgramResult result = cnerf(words);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("motion: "));
  const auto motion = nlohmann::json::parse(read_text_file(out / "prepare.json")).at("motion");
  EXPECT_EQ(motion.at("steps"), 50);
  const auto shares = motion.value("shares", nlohmann::json::object());
  EXPECT_GT(shares.value("images/" + disturbed.stem().string() + ".png", 0.0), 0.05) << motion.dump();
  for (const View& view : load_capture(out).views) {
    const double hidden = double(std::ranges::count(view.image.mask, 0)) / double(view.image.pixel_count());
    EXPECT_NEAR(hidden, shares.value(view.name, 0.0), 0.02) << view.name;
  }
}

TEST(Prepare, APhotographWhoseNameIsNotUtf8IsLeftOut) {
  const TempDir folder;
  const UserFolder user = without_poses(folder.path());
  fs::copy_file(load_capture(tiny_capture()).views.front().image_file, user.photos / "caf\xE9.png");
  for (const std::string& progress : std::vector<std::string>{"plain", "json"}) {
    const fs::path out = folder / progress;
    const ProgramResult result = cnerf({"prepare", user.photos.string(), "-o", out.string(), "--colmap-model",
                                        user.model.string(), "--progress", progress});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_THAT(result.out, HasSubstr("left out: "));
    const auto record = nlohmann::json::parse(read_text_file(out / "prepare.json"));
    ASSERT_EQ(record.at("unreadable").size(), 1u) << progress;
    EXPECT_THAT(record.at("unreadable").at(0).get<std::string>(), HasSubstr("caf\uFFFD.png"));
    std::istringstream lines(result.out);
    for (std::string line; progress == "json" && std::getline(lines, line);) {
      EXPECT_TRUE(nlohmann::json::accept(line)) << line;
    }
  }
}

TEST(Prepare, WithoutColmapSaysHowToGetItAndGoesOnLater) {
  const TempDir folder;
  const UserFolder user = without_poses(folder.path());
  const std::string out = (folder / "capture").string();
  const ProgramResult result = [&] {
    const NoPrograms none;
    return cnerf({"prepare", user.photos.string(), "-o", out});
  }();
  EXPECT_EQ(result.exit_code, 69);
  EXPECT_THAT(result.err, HasSubstr("apt install colmap"));
  EXPECT_TRUE(fs::exists(fs::path(out) / "images"));
  EXPECT_FALSE(fs::exists(fs::path(out) / "transforms.json"));
  EXPECT_EQ(
      cnerf({"prepare", user.photos.string(), "-o", out, "--resume", "--colmap-model", user.model.string()}).exit_code,
      0);
}

TEST(Prepare, BadInputIsNamed) {
  const TempDir folder;
  const UserFolder user = without_poses(folder.path());
  const std::string out = (folder / "capture").string();
  const auto refused = [&](const std::vector<std::string>& words, int code, const std::string& message) {
    const ProgramResult result = cnerf(words);
    EXPECT_EQ(result.exit_code, code) << result.err;
    EXPECT_THAT(result.err, HasSubstr(message));
  };
  refused({"prepare", (folder / "absent").string(), "-o", out}, 66, "absent");
  write_file(folder / "broken.mp4", std::string_view("no film"));
  refused({"prepare", (folder / "broken.mp4").string(), "-o", out}, 65, "broken.mp4");
  fs::remove_all(out);
  refused({"prepare", user.photos.string(), "-o", out, "--frames", "1"}, 64, "frames");
  refused({"prepare", user.photos.string(), "-o", out, "--video-range", "full"}, 64, "video_range");
  refused({"prepare", user.photos.string(), "-o", folder.path().string()}, 64, "is not empty");
  write_file(user.photos / "x.heic", std::string_view("x"));
  refused({"prepare", user.photos.string(), "-o", out}, 65, "heif-convert");
}

}  // namespace
}  // namespace cnerf::test
