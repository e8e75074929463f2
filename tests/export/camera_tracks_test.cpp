/// Cameras as USD and as a Nuke track: points land on their pixels by the rules of those formats.

#include "export/camera_tracks.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>
#include <regex>
#include <sstream>

#include "export/bake_folder.h"
#include "export/up_axis.h"
#include "export/vdb_writer.h"
#include "src/base/files.h"
#include "tests/bake/analytic_field.h"
#include "tests/export/test_volumes.h"
#include "tests/support/data.h"

namespace cnerf::exporting::test {
using namespace cnerf::test;
using bake::test::camera_at;
namespace {

constexpr double kTrackTolerance = 1e-4;  // pixels
const std::vector<Vec3d> kPoints{{0, 0, 0}, {0.3, 0.1, -0.2}, {-0.2, 0.4, 0.3}};

/// A shot with zoom, roll and a principal point off the middle.
std::vector<bake::Camera> cameras() {
  std::vector<bake::Camera> all;
  for (const int frame : {12, 7, 9}) {
    bake::Camera camera =
        camera_at("images/shot_" + std::to_string(frame) + ".png", {2.0 + 0.1 * frame, -3, 1.5}, {0, 0, 0}, 64, 48, 70);
    const double roll = 0.1 * frame;
    const Mat3d turn{{{std::cos(roll), -std::sin(roll), 0}, {std::sin(roll), std::cos(roll), 0}, {0, 0, 1}}};
    camera.world_from_camera.linear = camera.world_from_camera.linear * turn;
    camera.intrinsics.fx += frame;
    camera.intrinsics.fy += 1.1 * frame;
    camera.intrinsics.cx += 3;
    camera.intrinsics.cy -= 2;
    all.push_back(camera);
  }
  return all;
}

std::vector<double> numbers_in(const std::string& text) {
  static const std::regex number(R"(-?\d+(?:\.\d+)?(?:e[-+]?\d+)?)");
  std::vector<double> found;
  for (std::sregex_iterator at(text.begin(), text.end(), number), end; at != end; ++at) {
    found.push_back(std::stod(at->str()));
  }
  return found;
}

/// The text between two marks, of which the first is looked for from a third on.
std::string between(const std::string& text, const std::string& from, const std::string& begin,
                    const std::string& end) {
  const std::size_t start = text.find(begin, text.find(from));
  EXPECT_NE(text.find(from), std::string::npos) << from;
  EXPECT_NE(start, std::string::npos) << begin;
  return text.substr(start + begin.size(), text.find(end, start + begin.size()) - start - begin.size());
}

struct UsdCamera {
  std::vector<double> matrix;          ///< 16, for row vectors
  std::map<std::string, double> lens;  ///< by attribute
  [[nodiscard]] PixelPosition pixel(Vec3d p, const Intrinsics& size) const {
    // p = (x, y, z) * rows + translation, and the rows are orthonormal.
    const auto row = [&](std::size_t i) { return Vec3d{matrix[4 * i], matrix[4 * i + 1], matrix[4 * i + 2]}; };
    const Vec3d away = p - row(3);
    const double x = dot(away, row(0)), y = dot(away, row(1)), depth = -dot(away, row(2));
    EXPECT_GT(depth, 0);
    const double focal = lens.at("focalLength");
    const double width = lens.at("horizontalAperture"), height = lens.at("verticalAperture");
    const double left = lens.at("horizontalApertureOffset") - width / 2;
    const double top = lens.at("verticalApertureOffset") + height / 2;
    return {(focal * x / depth - left) / width * size.width, (top - focal * y / depth) / height * size.height};
  }
};

const char* const kLens[] = {"focalLength", "horizontalAperture", "verticalAperture", "horizontalApertureOffset",
                             "verticalApertureOffset"};

UsdCamera still_in(const std::string& usd, const std::string& name) {
  const std::string from = "def Camera \"" + name + "\"";
  UsdCamera camera;
  camera.matrix = numbers_in(between(usd, from, "xformOp:transform = ", "\n"));
  for (const char* attribute : kLens) {
    camera.lens[attribute] = std::stod(between(usd, from, std::string(" ") + attribute + " = ", "\n"));
  }
  return camera;
}

UsdCamera frame_in(const std::string& usd, int frame) {
  const std::string from = "def Camera \"shot\"", key = " " + std::to_string(frame) + ": ";
  UsdCamera camera;
  camera.matrix = numbers_in(between(between(usd, from, "transform.timeSamples = {", "}"), "", key, "\n"));
  for (const char* attribute : kLens) {
    const std::string samples = between(usd, from, std::string(" ") + attribute + ".timeSamples = {", "}");
    camera.lens[attribute] = std::stod(between(samples, "", key, ","));
  }
  return camera;
}

void expect_on_pixel(const PixelPosition& seen, const bake::Camera& camera, Vec3d p) {
  const auto truth = project(camera.intrinsics, camera.world_from_camera.inverse().point(p));
  ASSERT_TRUE(truth);
  EXPECT_NEAR(seen.x, truth->x, kTrackTolerance) << camera.name;
  EXPECT_NEAR(seen.y, truth->y, kTrackTolerance) << camera.name;
}

class CameraTracksUp : public testing::TestWithParam<std::pair<const char*, const char*>> {};

TEST_P(CameraTracksUp, PointsLandOnTheirPixelsInUsd) {
  const TempDir folder;
  const auto [up_axis, up] = GetParam();
  VdbOptions options;
  options.up = up;
  const Label label = label_of_first(up_axis);
  write_cameras_usd(cameras(), options, label, folder / "cameras.usda");
  const std::string usd = read_text_file(folder / "cameras.usda");
  const Affined turn = file_from_world(options, label.world);
  for (const bake::Camera& camera : cameras()) {
    const std::string stem = std::filesystem::path(camera.name).stem().string();
    const UsdCamera still = still_in(usd, "camera_" + stem);
    const UsdCamera moving = frame_in(usd, std::stoi(stem.substr(5)));
    ASSERT_EQ(still.matrix.size(), 16u);
    EXPECT_EQ(still.matrix, moving.matrix);
    for (const Vec3d& p : kPoints) {
      expect_on_pixel(still.pixel(turn.point(p), camera.intrinsics), camera, p);
      expect_on_pixel(moving.pixel(turn.point(p), camera.intrinsics), camera, p);
    }
  }
  EXPECT_NE(usd.find("startTimeCode = 7\n    endTimeCode = 12\n"), std::string::npos);
  EXPECT_EQ(usd.find("rotateXYZ") != std::string::npos, std::string(up_axis) == "x" && std::string(up) == "poses");
}
INSTANTIATE_TEST_SUITE_P(Axes, CameraTracksUp,
                         testing::Values(std::pair("z", "poses"), std::pair("y", "poses"), std::pair("x", "poses"),
                                         std::pair("z", "y"), std::pair("y", "z"), std::pair("x", "y")));

/// UsdGeomCamera: "in tenths of a world unit", so that they are millimetres where a unit is a centimetre.
TEST(CameraTracks, LensesInUsdAreTenthsOfAUnit) {
  const TempDir folder;
  const bake::Camera camera = cameras().front();
  const double focal_mm = 36 * camera.intrinsics.fx / camera.intrinsics.width;
  for (const double metres_per_unit : {0.01, 1.0}) {
    Label label = label_of_first();
    label.world.metres_per_unit = metres_per_unit;
    write_cameras_usd({camera}, {}, label, folder / "cameras.usda");
    const std::string usd = read_text_file(folder / "cameras.usda");
    const double millimetres = 100 * metres_per_unit;  // in a tenth of a unit
    for (const UsdCamera& found : {still_in(usd, "camera_shot_12"), frame_in(usd, 12)}) {
      EXPECT_NEAR(millimetres * found.lens.at("horizontalAperture"), 36, 1e-9) << metres_per_unit;
      EXPECT_NEAR(millimetres * found.lens.at("focalLength"), focal_mm, 1e-9) << metres_per_unit;
      EXPECT_NEAR(millimetres * found.lens.at("horizontalApertureOffset"), -36 * 3 / 64.0, 1e-9) << metres_per_unit;
    }
  }
}

/// R = Ry Rx Rz, as Nuke's order ZXY says.
Mat3d rotation_zxy(Vec3d degrees) {
  const Vec3d r = degrees * (std::numbers::pi / 180);
  const double cx = std::cos(r.x), sx = std::sin(r.x), cy = std::cos(r.y), sy = std::sin(r.y), cz = std::cos(r.z),
               sz = std::sin(r.z);
  const Mat3d about_x{{{1, 0, 0}, {0, cx, -sx}, {0, sx, cx}}}, about_y{{{cy, 0, sy}, {0, 1, 0}, {-sy, 0, cy}}},
      about_z{{{cz, -sz, 0}, {sz, cz, 0}, {0, 0, 1}}};
  return about_y * about_x * about_z;
}

std::map<int, std::vector<double>> chan_lines(const std::filesystem::path& file) {
  std::map<int, std::vector<double>> lines;
  std::istringstream text(read_text_file(file));
  for (std::string line; std::getline(text, line);) {
    if (line.starts_with("#")) continue;
    std::vector<double> words = numbers_in(line);
    EXPECT_EQ(words.size(), 8u) << line;
    const int frame = int(words.front());
    words.erase(words.begin());
    lines[frame] = words;
  }
  return lines;
}

TEST(CameraTracks, PointsLandOnTheirPixelsInNuke) {
  for (const char* up_axis : {"x", "y", "z"}) {
    const TempDir folder;
    std::vector<bake::Camera> shot = cameras();
    for (bake::Camera& camera : shot) {  // what the format cannot hold
      Intrinsics& lens = camera.intrinsics;
      lens.fx = lens.fy;
      lens.cx = lens.width / 2.0;
      lens.cy = lens.height / 2.0;
    }
    const Label label = label_of_first(up_axis);
    write_chan(shot, label.world, folder / "cameras.chan");
    const auto lines = chan_lines(folder / "cameras.chan");
    ASSERT_EQ(lines.size(), 3u);
    for (const bake::Camera& camera : shot) {
      const std::vector<double>& line = lines.at(std::stoi(camera.name.substr(12)));
      const Mat3d rotation = rotation_zxy({line[3], line[4], line[5]});
      for (const Vec3d& p : kPoints) {
        const Vec3d away = turned_up(up_axis, "y").point(p) - Vec3d{line[0], line[1], line[2]};
        const Vec3d q = rotation.transposed() * away;  // looks along -Z, +Y up
        const double pixels = camera.intrinsics.height / 2.0 / std::tan(line[6] * std::numbers::pi / 360);
        expect_on_pixel({32 + pixels * q.x / -q.z, 24 + pixels * q.y / q.z}, camera, p);
      }
    }
  }
}

/// Once around, and straight down: angles go on where they were, and nothing is lost at the pole.
TEST(CameraTracks, AnglesDoNotJump) {
  const TempDir folder;
  std::vector<bake::Camera> shot;
  for (int i = 0; i < 40; ++i) {
    const double angle = 4 * std::numbers::pi * i / 39;  // twice
    shot.push_back(camera_at(std::to_string(i), {3 * std::cos(angle), 3 * std::sin(angle), 1}, {0, 0, 0}, 8, 8, 9));
  }
  shot.push_back({"40", shot[0].intrinsics, {{{{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}}, {0, 0, 5}}});
  write_chan(shot, label_of_first("z").world, folder / "cameras.chan");
  const auto lines = chan_lines(folder / "cameras.chan");
  double turned = 0;
  for (int i = 1; i < 40; ++i) {
    for (std::size_t axis = 3; axis < 6; ++axis) EXPECT_LT(std::abs(lines.at(i)[axis] - lines.at(i - 1)[axis]), 180);
    turned += lines.at(i)[4] - lines.at(i - 1)[4];
  }
  EXPECT_NEAR(std::abs(turned), 720, 1e-6);
  const Mat3d down = rotation_zxy({lines.at(40)[3], lines.at(40)[4], lines.at(40)[5]});
  const Mat3d truth = turned_up("z", "y").linear * Mat3d{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) EXPECT_NEAR(down.rows[row][column], truth.rows[row][column], 1e-6);
  }
}

TEST(CameraTracks, FramesAreNumbersOfPicturesOrTheirOrder) {
  std::vector<bake::Camera> shot(3);
  shot[0].name = "b.png";
  shot[1].name = "a_7.png";
  shot[2].name = "a_3.png";
  const auto numbers = [&] {
    std::string text;
    for (const ShotFrame& frame : frames_of_shot(shot)) text += std::to_string(frame.number) + frame.camera->name + " ";
    return text;
  };
  EXPECT_EQ(numbers(), "1b.png 2a_7.png 3a_3.png ");
  shot[0].name = "20260101123456_5.png";
  EXPECT_EQ(numbers(), "3a_3.png 520260101123456_5.png 7a_7.png ");
  shot[0].name = "20260101123456.png";
  EXPECT_EQ(numbers(), "120260101123456.png 2a_7.png 3a_3.png ");
  const auto name = [&](const std::vector<std::string>& names) {
    shot.assign(names.size(), {});
    for (std::size_t i = 0; i < names.size(); ++i) shot[i].name = names[i];
  };
  name({"IMG_20240501_142301.jpg", "IMG_20240501_142233.jpg"});
  EXPECT_EQ(numbers(), "1IMG_20240501_142301.jpg 2IMG_20240501_142233.jpg ") << "the time of day";
  name({"frame_000123.png", "frame_000007.png"});
  EXPECT_EQ(numbers(), "7frame_000007.png 123frame_000123.png ");
  name({"b_7.png", "a_7.png", "a_3.png"});
  EXPECT_EQ(numbers(), "1b_7.png 2a_7.png 3a_3.png ");
  EXPECT_TRUE(frames_of_shot({}).empty());
}

TEST(CameraTracks, StandBesideABakeAndInItsManifest) {
  const TempDir folder;
  std::vector<bake::Camera> two = {cameras()[0], cameras()[0]};
  two[1].name = "other/shot_12.png";  // the same prim but for a number
  BakeFolder bake(folder.path(), two, label_of_first());
  bake.add_volumes({planes_of(block_volume({0, 0, 0}, {4, 4, 4}, 1))}, "volume", {});
  bake.add_camera_tracks({});
  bake.finish();
  const std::vector<std::string> files = read_manifest(bake.manifest()).files;
  for (const char* file : {"cameras.usda", "cameras.chan"}) EXPECT_EQ(std::ranges::count(files, file), 1) << file;
  const std::string usd = read_text_file(folder / "cameras.usda");
  EXPECT_EQ(still_in(usd, "camera_shot_12").matrix, still_in(usd, "camera_shot_12_2").matrix);
  EXPECT_NE(usd.find("builtin"), std::string::npos) << "who coloured it";
}

}  // namespace
}  // namespace cnerf::exporting::test
