#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <numbers>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/capture/load_capture.h"
#include "tests/capture/expectations.h"
#include "tests/capture/fixtures.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

namespace fs = std::filesystem;
using testing::Contains;
using testing::HasSubstr;

constexpr const char* kColumns = "#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\n";

/// Angles in degrees.
struct Angles {
  double heading, pitch, roll;
};

/// Of the columns of world_from_camera = turn(Z, -heading) * turn(X, pitch) * turn(Y, roll), whose camera has +Y up and
/// looks along -Z.
Angles angles_of(const Affined& world_from_camera) {
  const Vec3d right = world_from_camera.linear.column(0);
  const Vec3d up = -world_from_camera.linear.column(1);
  const Vec3d back = -world_from_camera.linear.column(2);
  constexpr double kDegrees = 180 / std::numbers::pi;
  return {std::atan2(up.x, up.y) * kDegrees, std::asin(up.z) * kDegrees, std::atan2(-right.z, back.z) * kDegrees};
}

std::string comma_separated(const std::vector<double>& numbers) {
  std::string text = test::text_of(numbers);
  std::ranges::replace(text, ' ', ',');
  return text;
}

std::string line_of(const std::string& name, const Affined& pose, const std::string& lens = "45,0,0,0,0,0,0,0,0") {
  const auto [heading, pitch, roll] = angles_of(pose);
  const Vec3d p = pose.translation;
  return name + "," + comma_separated({p.x, p.y, p.z, heading, pitch, roll}) + "," + lens + "\n";
}

/// A table of four cameras of the ring, and their images.
std::string ring_table(const fs::path& folder, const std::string& lens = "45,0,0,0,0,0,0,0,0") {
  std::string table = kColumns;
  for (int i = 0; i < 4; ++i) {
    const std::string name = std::to_string(i) + ".png";
    test::write_grey_image(folder / "images" / name, test::kWidth, test::kHeight, i);
    table += line_of(name, test::ring_pose(i, 4), lens);
  }
  return table;
}

/// A sidecar. RealityCapture has written numbers as attributes in some versions and as elements in others.
std::string sidecar(const std::vector<double>& rotation, Vec3d position, const std::string& attributes,
                    const std::string& coefficients = "0 0 0 0 0 0") {
  return "<x:xmpmeta xmlns:x=\"adobe:ns:meta/\">\n<rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\">\n"
         "<rdf:Description xcr:Version=\"3\" xcr:PosePrior=\"exact\" " +
         attributes + " xmlns:xcr=\"http://www.capturingreality.com/ns/xcr/1.1#\">\n<xcr:Rotation>" +
         test::text_of(rotation) + "</xcr:Rotation>\n<xcr:Position>" +
         test::text_of({position.x, position.y, position.z}) + "</xcr:Position>\n<xcr:DistortionCoeficients>" +
         coefficients + "</xcr:DistortionCoeficients>\n</rdf:Description></rdf:RDF></x:xmpmeta>\n";
}
std::string sidecar_of(const Affined& pose, const std::string& attributes,
                       const std::string& coefficients = "0 0 0 0 0 0") {
  return sidecar(test::rows_of(pose.linear.transposed()), pose.translation, attributes, coefficients);
}
constexpr const char* kPlainLens = "xcr:DistortionModel=\"perspective\" xcr:FocalLength35mm=\"45\"";

void write_ring_sidecars(const fs::path& folder, const std::string& attributes,
                         const std::string& coefficients = "0 0 0 0 0 0") {
  for (int i = 0; i < 4; ++i) {
    const std::string name = std::to_string(i);
    test::write_grey_image(folder / (name + ".png"), test::kWidth, test::kHeight, i);
    write_file(folder / (name + ".xmp"), sidecar_of(test::ring_pose(i, 4), attributes, coefficients));
  }
}

void expect_read_ring(const Capture& capture) {
  EXPECT_EQ(capture.format, "realitycapture");
  test::expect_ring(capture);
}

// ---- table ----------------------------------------------------------------------------------------------------------

TEST(RealityCaptureTable, PosesAndLensesAreRead) {
  const test::TempDir folder;
  write_file(folder / "cameras.csv", ring_table(folder.path(), "45,0.03125,-0.0625,-0.1,0.05,-0.02,0,0.004,-0.007"));
  const Capture capture = load_capture(folder.path());
  expect_read_ring(capture);
  const Intrinsics wanted = {LensModel::kOpenCv, 16, 12, 20, 20, 8.5, 5, {-0.1, 0.05, -0.007, 0.004, -0.02}};
  test::expect_same_lens(capture.views[0].intrinsics, wanted);
}

TEST(RealityCaptureTable, AByteOrderMarkCarriageReturnsAndOtherTablesAreNoHindrance) {
  const test::TempDir folder;
  std::string table = "\xEF\xBB\xBF" + ring_table(folder.path());
  for (std::size_t at = 0; (at = table.find('\n', at)) != std::string::npos; at += 2) table.insert(at, 1, '\r');
  write_file(folder / "all.CSV", table);
  write_file(folder / "a.csv", "#name,x,y\n");
  write_file(folder / "b.csv", "time,place\n1,2\n");
  expect_read_ring(load_capture(folder.path()));
  expect_read_ring(load_capture(folder / "images" / ".." / "all.CSV"));
}

/// As Epic describes it: without turns the camera looks down, the top of its picture to the north (+Y), its right side
/// to the east (+X).
TEST(RealityCaptureTable, ACameraWithoutTurnsSeesNorthAbove) {
  const test::TempDir folder;
  (void)ring_table(folder.path());
  write_file(folder / "a.csv", std::string(kColumns) + "0.png,100,200,50,0,0,0,45,0,0,0,0,0,0,0,0\n" +
                                   "1.png,100,200,50,90,0,0,45,0,0,0,0,0,0,0,0\n");
  const Capture capture = load_capture(folder.path());
  const auto pixel_of = [&](std::size_t view, Vec3d world) {
    return project(capture.views[view].intrinsics, capture.views[view].world_from_camera.inverse().point(world))
        .value();
  };
  EXPECT_NEAR(pixel_of(0, {100, 210, 0}).y, 6 - 20 * 10.0 / 50, 1e-9);  // to the north: above the middle
  EXPECT_NEAR(pixel_of(0, {105, 200, 0}).x, 8 + 20 * 5.0 / 50, 1e-9);   // to the east: right of it
  EXPECT_NEAR(pixel_of(1, {110, 200, 0}).y, 6 - 20 * 10.0 / 50, 1e-9);  // heading east, the east is above
  EXPECT_NEAR(pixel_of(1, {100, 195, 0}).x, 8 + 20 * 5.0 / 50, 1e-9);   // and the south on the right
}

/// What RealityCapture wrote of one camera in both ways (forums.unrealengine.com/t/710449).
TEST(RealityCapture, TableAndSidecarOfOneCameraAgree) {
  const Vec3d right = {0.982594073038806, 0.185426733553445, -0.0112166890261935};
  const Vec3d down = {-0.032113633044729, 0.11008102707942, -0.993403685341366};
  const Vec3d forward = cross(right, down);
  const test::TempDir table, sidecars;
  for (const char* name : {"0", "1"}) {
    test::write_grey_image(table / (name + std::string(".png")));
    test::write_grey_image(sidecars / (name + std::string(".png")));
    write_file(sidecars / (name + std::string(".xmp")),
               sidecar(test::rows_of({{right, down, forward}}), {1, 2, 3}, kPlainLens));
  }
  const std::string camera = ".png,1,2,3,163.736597399311,83.4154313461628,174.386496244756,45,0,0,0,0,0,0,0,0\n";
  write_file(table / "a.csv", kColumns + ("0" + camera) + ("1" + camera));
  const View from_table = load_capture(table.path()).views[0];
  const View from_sidecar = load_capture(sidecars.path()).views[0];
  EXPECT_NEAR(forward.x, -0.18296885582437, 1e-9);  // the third row, as far as it was quoted whole
  test::expect_same_pose(from_table.world_from_camera, from_sidecar.world_from_camera);
  test::expect_same_lens(from_table.intrinsics, from_sidecar.intrinsics);
}

TEST(RealityCaptureTable, LengthsAreThoseOfTheLongerSide) {
  const test::TempDir folder;
  (void)ring_table(folder.path());
  for (const char* name : {"0.png", "1.png"}) test::write_grey_image(folder / "images" / name, 12, 16);
  write_file(folder / "a.csv", kColumns + line_of("0.png", test::ring_pose(0, 4), "45,0.125,0.0625,0,0,0,0,0,0") +
                                   line_of("1.png", test::ring_pose(1, 4)));
  const Intrinsics wanted = {LensModel::kPinhole, 12, 16, 20, 20, 8, 9, {}};
  test::expect_same_lens(load_capture(folder.path()).views[0].intrinsics, wanted);
}

TEST(RealityCaptureTable, MissingImagesAreLeftOut) {
  const test::TempDir folder;
  write_file(folder / "a.csv", ring_table(folder.path()));
  test::expect_missing_image_left_out(folder.path(), folder / "images/1.png");
}

TEST(RealityCaptureTable, PositionsOnAMapComeToTheOrigin) {
  const test::TempDir folder;
  (void)ring_table(folder.path());
  const auto at = [](double x, double y) { return Affined{test::ring_pose(0, 4).linear, {x, y, 12.5}}; };
  write_file(folder / "a.csv",
             kColumns + line_of("0.png", at(500000.25, 5400000)) + line_of("1.png", at(500003, 5400004)));
  const Capture capture = load_capture(folder.path());
  ASSERT_EQ(capture.views.size(), 2u);
  const Vec3d step = capture.views[1].world_from_camera.translation - capture.views[0].world_from_camera.translation;
  EXPECT_LT(length(capture.views[0].world_from_camera.translation), 1);
  EXPECT_LT(length(step - Vec3d{2.75, 4, 0}), 1e-6);
  EXPECT_THAT(capture.notes, Contains(HasSubstr("relative to 500000 5400000")));
}

TEST(RealityCaptureTable, BadLinesAreRefused) {
  const test::TempDir folder;
  const std::string good = ring_table(folder.path());
  const auto refuse = [&](const std::string& from, const std::string& to, const std::vector<std::string>& says) {
    std::string text = good;
    const std::size_t at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    write_file(folder / "a.csv", text.replace(at, from.size(), to));
    test::expect_input_error(folder / "a.csv", says);
  };
  refuse(",45,0,0,0,0,0,0,0,0\n", ",45,0,0,0\n", {"a.csv", "line 2", "expected 16 values, found 11"});
  refuse(",45,", ",wide,", {"line 2.f", "expected a number", "wide"});
  refuse(",45,", ",inf,", {"line 2.f", "expected a number", "inf"});
  refuse(",45,", ",0,", {"line 2.focal length", "above 0, found 0"});
  refuse(",45,0,0,0,0,0,0,", ",45,0,0,0,0,0,0.5,", {"line 2.distortion k4", "expected 0, found 0.5"});
  refuse(",45,0,0,0,", ",45,0,0,1e6,", {"line 2.distortion", "found 1e+06"});
  refuse("0.png,", ",", {"line 2.name", "expected a file name"});
  refuse("heading", "yaw", {"a.csv", "line 1", "expected a column heading"});
  refuse("#name", "name", {"a.csv", "line 1", "expected #name"});
  try {
    (void)load_capture(folder.path());
    FAIL() << "a folder without a table was taken";
  } catch (const MissingInputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("nor does a.csv state any"));
  }
}

// ---- sidecars -------------------------------------------------------------------------------------------------------

TEST(RealityCaptureSidecars, PosesAndLensesAreRead) {
  const test::TempDir folder;
  write_ring_sidecars(
      folder / "images",
      "xcr:DistortionModel=\"brown3t2\" xcr:FocalLength35mm=\"45\" xcr:Skew=\"0\" xcr:AspectRatio=\"1.05\" "
      "xcr:PrincipalPointU=\"0.03125\" xcr:PrincipalPointV=\"-0.0625\"",
      "-0.1 0.05 -0.02 0 0.004 -0.007");
  const Capture capture = load_capture(folder.path());
  expect_read_ring(capture);
  EXPECT_EQ(capture.views[1].name, "1.png");
  const Intrinsics wanted = {LensModel::kOpenCv, 16, 12, 20, 21, 8.5, 5, {-0.1, 0.05, -0.007, 0.004, -0.02}};
  test::expect_same_lens(capture.views[0].intrinsics, wanted);
}

TEST(RealityCaptureSidecars, ValuesMayBeAttributes) {
  const test::TempDir folder;
  write_ring_sidecars(folder.path(), kPlainLens);
  for (int i = 0; i < 4; ++i) {
    const Affined pose = test::ring_pose(i, 4);
    const std::string rotation = test::text_of(test::rows_of(pose.linear.transposed()));
    const Vec3d p = pose.translation;
    write_file(
        folder / (std::to_string(i) + ".xmp"),
        "<x:xmpmeta><rdf:RDF><rdf:Description dc:creator=\"somebody\"/><rdf:Description xcr:FocalLength35mm=\"45\" "
        "xmlns:xcr=\"http://www.capturingreality.com/ns/xcr/1.1#\" xcr:Rotation=\"" +
            rotation + "\" xcr:Position=\"" + test::text_of({p.x, p.y, p.z}) + "\"/></rdf:RDF></x:xmpmeta>");
  }
  expect_read_ring(load_capture(folder.path()));
}

TEST(RealityCaptureSidecars, ImagesWithoutAPoseAreLeftOut) {
  const test::TempDir folder;
  write_ring_sidecars(folder.path(), kPlainLens);
  write_file(folder / "1.xmp", "<x:xmpmeta><rdf:RDF><rdf:Description/></rdf:RDF></x:xmpmeta>");
  const Capture capture = load_capture(folder.path());
  EXPECT_EQ(capture.views.size(), 3u);
  EXPECT_THAT(capture.notes, Contains(HasSubstr("1 of 4 sidecars state no pose")));
}

TEST(RealityCaptureSidecars, ThoseOfOtherProgramsAreNoPoses) {
  const test::TempDir folder;
  write_file(folder / "0.xmp", "<x:xmpmeta><rdf:RDF><rdf:Description crs:Exposure=\"1\"/></rdf:RDF></x:xmpmeta>");
  test::write_grey_image(folder / "0.png");
  EXPECT_FALSE(holds_poses(folder.path()));
  EXPECT_THROW((void)load_capture(folder.path()), MissingInputError);
}

TEST(RealityCaptureSidecars, WhatNoLensModelHasIsRefused) {
  const auto refuse = [](const std::string& attributes, const std::string& coefficients,
                         const std::vector<std::string>& says) {
    const test::TempDir folder;
    write_ring_sidecars(folder.path(), attributes, coefficients);
    test::expect_input_error(folder.path(), says);
  };
  const std::string focal = "xcr:FocalLength35mm=\"45\" ";
  refuse(focal + "xcr:DistortionModel=\"division\"", "-0.2 0 0 0 0 0",
         {"0.xmp", "xcr:DistortionModel", "found division"});
  refuse(focal + "xcr:DistortionModel=\"brown4\"", "-0.2 0 0 0.1 0 0", {"0.xmp", "distortion k4", "found 0.1"});
  refuse(focal + "xcr:DistortionModel=\"brown3\"", "-0.2 0",
         {"xcr:DistortionCoeficients", "expected 6 numbers, found 2"});
  refuse(focal + "xcr:Skew=\"0.1\"", "0 0 0 0 0 0", {"xcr:Skew", "expected 0, found 0.1"});
  refuse("xcr:FocalLength35mm=\"long\"", "0 0 0 0 0 0", {"xcr:FocalLength35mm", "expected a number", "long"});
  refuse("", "0 0 0 0 0 0", {"xcr:FocalLength35mm", "expected a number"});
}

TEST(RealityCaptureSidecars, AMirroredRotationIsRefused) {
  const test::TempDir folder;
  write_ring_sidecars(folder.path(), kPlainLens);
  write_file(folder / "0.xmp", sidecar({1, 0, 0, 0, 1, 0, 0, 0, -1}, {1, 2, 3}, kPlainLens));
  test::expect_input_error(folder.path(), {"0.xmp", "xcr.Rotation", "mirrored"});
}

}  // namespace
}  // namespace cnerf
