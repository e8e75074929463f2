#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
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
using testing::Contains;
using testing::HasSubstr;

/// world = scale * rotation * chunk + translation
struct Similarity {
  Mat3d rotation = Mat3d::identity();
  Vec3d translation;
  double scale = 1;

  [[nodiscard]] Affined chunk_from(const Affined& world_from_camera) const {
    const Mat3d inverse = rotation.transposed();
    return {inverse * world_from_camera.linear, inverse * (world_from_camera.translation - translation) / scale};
  }
  [[nodiscard]] std::string xml() const {
    const Vec3d t = translation;
    return "<transform><rotation locked=\"true\">" + test::text_of(test::rows_of(rotation)) +
           "</rotation><translation locked=\"true\">" + test::text_of({t.x, t.y, t.z}) +
           "</translation><scale locked=\"true\">" + test::text_of({scale}) + "</scale></transform>";
  }
};

/// Any similarity will do that exchanges axes, shifts and scales.
Similarity some_similarity() {
  return {test::ring_pose(1, 5).linear, {10, -20, 30}, 2.5};
}

std::string camera_xml(int index, const Affined& chunk_from_camera, const std::string& attributes = "") {
  std::vector<double> m;
  for (int r = 0; r < 3; ++r) {
    const Vec3d row = chunk_from_camera.linear.rows[r];
    m.insert(m.end(), {row.x, row.y, row.z, chunk_from_camera.translation[r]});
  }
  m.insert(m.end(), {0, 0, 0, 1});
  const std::string id = std::to_string(index);
  return "<camera id=\"" + id + "\" sensor_id=\"0\" label=\"" + id + "\" " + attributes + "><transform>" +
         test::text_of(m) + "</transform><orientation>1</orientation></camera>\n";
}

constexpr const char* kLens = "<f>20</f><cx>0.5</cx><cy>-0.25</cy><b1>1</b1>";

/// What a cameras.xml is made of.
struct Document {
  std::string lens = kLens;
  std::string type = "frame";
  std::string cameras, components, transform;

  [[nodiscard]] std::string xml() const {
    return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<document version=\"2.0.0\"><chunk label=\"Chunk 1\" "
           "enabled=\"true\"><sensors next_id=\"1\"><sensor id=\"0\" label=\"a lens\" type=\"" +
           type +
           "\"><resolution width=\"16\" height=\"12\"/><property name=\"layer_index\" value=\"0\"/>"
           "<calibration type=\"" +
           type +
           "\" class=\"initial\"><resolution width=\"16\" height=\"12\"/><f>99</f></calibration><calibration type=\"" +
           type + "\" class=\"adjusted\"><resolution width=\"16\" height=\"12\"/>" + lens +
           "</calibration></sensor></sensors>" + components + "<cameras next_id=\"4\">" + cameras + "</cameras>" +
           transform + "</chunk></document>\n";
  }
};

/// A capture of four cameras of the ring and their images, which labels name without extension.
Document ring_document(const fs::path& folder, const Similarity& world_from_chunk = {}) {
  Document document;
  for (int i = 0; i < 4; ++i) {
    test::write_grey_image(folder / "images" / (std::to_string(i) + ".png"), test::kWidth, test::kHeight, i);
    document.cameras += camera_xml(i, world_from_chunk.chunk_from(test::ring_pose(i, 4)));
  }
  return document;
}

void write(const fs::path& folder, const Document& document) {
  write_file(folder / "cameras.xml", document.xml());
}

TEST(Metashape, PosesLeadThroughTheTransformOfTheChunk) {
  const test::TempDir folder;
  Document document = ring_document(folder.path(), some_similarity());
  document.transform = some_similarity().xml();
  write(folder.path(), document);
  const Capture capture = load_capture(folder.path());
  EXPECT_EQ(capture.format, "metashape");
  test::expect_ring(capture);
  EXPECT_EQ(capture.views[2].name, "2");
  EXPECT_EQ(capture.views[2].image_file, folder / "images" / "2.png");
}

TEST(Metashape, WithoutATransformTheChunkIsTheWorld) {
  const test::TempDir folder;
  write(folder.path(), ring_document(folder.path()));
  test::expect_ring(load_capture(folder / "cameras.xml"));
}

TEST(Metashape, TransformsOfComponentsComeBeforeThatOfTheChunk) {
  const test::TempDir folder;
  const Similarity other = {test::ring_pose(2, 7).linear, {1, 2, 3}, 0.5};
  Document document = ring_document(folder.path());
  document.cameras.clear();
  for (int i = 0; i < 4; ++i) {
    const Similarity& own = i < 2 ? other : Similarity(some_similarity());
    document.cameras +=
        camera_xml(i, own.chunk_from(test::ring_pose(i, 4)), i < 2 ? "component_id=\"0\"" : "component_id=\"1\"");
  }
  document.components = "<components><component id=\"0\" label=\"A\">" + other.xml() +
                        "</component><component id=\"1\" label=\"B\">" + some_similarity().xml() +
                        "</component></components>";
  write(folder.path(), document);
  test::expect_ring(load_capture(folder.path()));
}

TEST(Metashape, ComponentsWithoutACommonFrameAreRefused) {
  const test::TempDir folder;
  Document document = ring_document(folder.path());
  document.cameras = camera_xml(0, test::ring_pose(0, 4), "component_id=\"0\"") +
                     camera_xml(1, test::ring_pose(1, 4), "component_id=\"1\"");
  document.components =
      "<components><component id=\"0\">" + some_similarity().xml() + "</component><component id=\"1\"/></components>";
  write(folder.path(), document);
  test::expect_input_error(folder.path(), {"cameras.xml", "components", "2 components", "found 1"});
}

TEST(Metashape, GeoreferencedPosesComeToTheOrigin) {
  const test::TempDir folder;
  const Similarity geocentric = {test::ring_pose(1, 5).linear, {-2499366.5, -4256836.25, 4029217.75}, 12};
  Document document = ring_document(folder.path());
  document.transform = geocentric.xml();
  write(folder.path(), document);
  const Capture capture = load_capture(folder.path());
  ASSERT_EQ(capture.views.size(), 4u);
  const Vec3d first = capture.views[0].world_from_camera.translation;
  EXPECT_LT(length(first), 1);
  const Vec3d between =
      geocentric.rotation * (test::ring_pose(3, 4).translation - test::ring_pose(0, 4).translation) * 12.0;
  const Vec3d found = capture.views[3].world_from_camera.translation - first;
  EXPECT_NEAR(length(found), length(between), 1e-6);
  // The height is that over the ellipsoid, and the north is towards the pole.
  const Vec3d place = {-2499366.5, -4256836.25, 4029217.75};
  const Vec3d up = normalized(Vec3d{place.x, place.y, place.z * std::pow(6378137.0 / 6356752.314245, 2)});
  EXPECT_NEAR(found.z, dot(between, up), 1e-3);
  EXPECT_NEAR(found.x, dot(between, normalized(cross(Vec3d{0, 0, 1}, up))), 1e-3);
  EXPECT_THAT(capture.notes, Contains(HasSubstr("Z up of -24")));
}

TEST(Metashape, LabelsWithoutExtensionFindFilesOfCapitalOnes) {
  const test::TempDir folder;
  write(folder.path(), ring_document(folder.path()));
  for (int i = 0; i < 4; ++i) {
    const std::string name = "images/" + std::to_string(i);
    test::write_grey_image(folder / (name + ".tif"));
    fs::rename(folder / (name + ".tif"), folder / (name + ".TIF"));
    fs::remove(folder / (name + ".png"));
  }
  EXPECT_EQ(load_capture(folder.path()).views.size(), 4u);
}

TEST(Metashape, CamerasWithoutPoseOrDisabledAreLeftOutAndGroupsAreOpened) {
  const test::TempDir folder;
  Document document = ring_document(folder.path());
  document.cameras = camera_xml(0, test::ring_pose(0, 4)) + "<group id=\"0\" label=\"shots\">" +
                     camera_xml(1, test::ring_pose(1, 4)) + "<camera id=\"2\" sensor_id=\"0\" label=\"2\"/></group>" +
                     camera_xml(3, test::ring_pose(3, 4), "enabled=\"false\"");
  write(folder.path(), document);
  const Capture capture = load_capture(folder.path());
  ASSERT_EQ(capture.views.size(), 2u);
  EXPECT_EQ(capture.views[1].name, "1");
  EXPECT_THAT(capture.notes, Contains(HasSubstr("2 of 4 cameras have no pose")));
}

TEST(Metashape, CamerasOfOneNameAreRefused) {
  const test::TempDir folder;
  Document document = ring_document(folder.path());
  document.cameras += camera_xml(2, test::ring_pose(3, 4));
  write(folder.path(), document);
  EXPECT_THAT([&] { (void)load_capture(folder.path()); },
              ThrowsMessage<InputError>(AllOf(HasSubstr("camera 2"), HasSubstr("images/2.png"))));
}

TEST(Metashape, MissingImagesAreLeftOut) {
  const test::TempDir folder;
  write(folder.path(), ring_document(folder.path()));
  test::expect_missing_image_left_out(folder.path(), folder / "images/1.png");
}

TEST(Metashape, LensIsTheAdjustedOne) {
  const test::TempDir folder;
  write(folder.path(), ring_document(folder.path()));
  const Intrinsics wanted = {LensModel::kPinhole, 16, 12, 21, 20, 8.5, 5.75, {}};
  test::expect_same_lens(load_capture(folder.path()).views[0].intrinsics, wanted);
}

/// The projection as the manual of Metashape writes it down for a frame camera.
TEST(Metashape, APointLandsWhereTheManualSays) {
  const test::TempDir folder;
  Document document = ring_document(folder.path());
  document.lens += "<k1>-0.1</k1><k2>0.05</k2><k3>-0.02</k3><p1>0.004</p1><p2>-0.007</p2>";
  write(folder.path(), document);
  const Vec3d point = {0.3, -0.2, 1.25};  // X right, Y down, Z forward
  const double x = point.x / point.z, y = point.y / point.z, s = x * x + y * y;
  const double radial = 1 - 0.1 * s + 0.05 * s * s - 0.02 * s * s * s;
  const double xd = x * radial + 0.004 * (s + 2 * x * x) + 2 * -0.007 * x * y;
  const double yd = y * radial - 0.007 * (s + 2 * y * y) + 2 * 0.004 * x * y;
  const auto pixel = project(load_capture(folder.path()).views[0].intrinsics, point);
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->x, 16 * 0.5 + 0.5 + xd * 20 + xd * 1, 1e-9);
  EXPECT_NEAR(pixel->y, 12 * 0.5 - 0.25 + yd * 20, 1e-9);
}

TEST(Metashape, APointLandsWhereTheManualSaysForFisheyes) {
  const test::TempDir folder;
  Document document = ring_document(folder.path());
  document.type = "equidistant_fisheye";
  document.lens += "<k1>-0.1</k1><k2>0.05</k2><k3>-0.02</k3><k4>0.01</k4>";
  write(folder.path(), document);
  const Vec3d point = {0.9, -0.5, 1.25};
  const double x0 = point.x / point.z, y0 = point.y / point.z, r0 = std::hypot(x0, y0);
  const double x = x0 * std::atan(r0) / r0, y = y0 * std::atan(r0) / r0, s = x * x + y * y;
  const double radial = 1 - 0.1 * s + 0.05 * s * s - 0.02 * s * s * s + 0.01 * s * s * s * s;
  const auto pixel = project(load_capture(folder.path()).views[0].intrinsics, point);
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->x, 8.5 + x * radial * 21, 1e-9);
  EXPECT_NEAR(pixel->y, 5.75 + y * radial * 20, 1e-9);
}

TEST(Metashape, AShearOfLessThanHalfAPixelIsLeftOut) {
  const test::TempDir folder;
  Document document = ring_document(folder.path());
  document.lens += "<b2>1.6</b2>";  // times 6 / 20
  write(folder.path(), document);
  EXPECT_EQ(load_capture(folder.path()).views.size(), 4u);
}

struct BadDocument {
  std::string name;
  std::string from, to;  ///< in the text of a good one
  std::vector<std::string> says;
};
void PrintTo(const BadDocument& bad, std::ostream* out) {
  *out << bad.name;
}
class BadMetashape : public testing::TestWithParam<BadDocument> {};

TEST_P(BadMetashape, IsRefused) {
  const BadDocument& bad = GetParam();
  const test::TempDir folder;
  std::string text = ring_document(folder.path()).xml();
  const std::size_t at = text.find(bad.from);
  ASSERT_NE(at, std::string::npos);
  write_file(folder / "cameras.xml", text.replace(at, bad.from.size(), bad.to));
  test::expect_input_error(folder.path(), bad.says);
}

INSTANTIATE_TEST_SUITE_P(
    Documents, BadMetashape,
    testing::Values(
        BadDocument{"radial_of_8th_order",
                    "<b1>",
                    "<k4>0.01</k4><b1>",
                    {"cameras.xml", "sensor 0.calibration.k4", "expected 0, found 0.01"}},
        BadDocument{"shear", "<b1>", "<b2>1.7</b2><b1>", {"sensor 0.calibration.b2", "found 1.7"}},
        BadDocument{"no_focal_length", "<f>20</f>", "", {"sensor 0.calibration.f", "found none"}},
        BadDocument{"focal_length_0", "<f>20</f>", "<f>0</f>", {"sensor 0.calibration.f", "above 0, found 0"}},
        BadDocument{"not_finite", "<f>20</f>", "<f>nan</f>", {"sensor 0.calibration.f", "expected a number", "nan"}},
        BadDocument{"out_of_range", "<f>20</f>", "<f>1e999</f>", {"calibration.f", "1e999"}},
        BadDocument{"two_numbers", "<f>20</f>", "<f>20 21</f>", {"calibration.f", "expected a number", "20 21"}},
        BadDocument{"spherical",
                    "<calibration type=\"frame\" class=\"adjusted\">",
                    "<calibration type=\"spherical\" class=\"adjusted\">",
                    {"calibration.type", "found spherical"}},
        BadDocument{"no_width",
                    "<resolution width=\"16\" height=\"12\"/><f>20",
                    "<resolution height=\"12\"/><f>20",
                    {"resolution.width", "expected a number"}},
        BadDocument{"broken_size",
                    "<resolution width=\"16\" height=\"12\"/><f>20",
                    "<resolution width=\"16\" height=\"1.5\"/><f>20",
                    {"resolution.height", "found 1.5"}},
        BadDocument{"unknown_sensor", "sensor_id=\"0\"", "sensor_id=\"7\"", {"camera 0.sensor_id", "found 7"}},
        BadDocument{"15_numbers",
                    "0 0 0 1</transform>",
                    "0 0 1</transform>",
                    {"camera 0.transform", "expected 16 numbers, found 15"}},
        BadDocument{"last_row",
                    "0 0 0 1</transform>",
                    "0 0 0 2</transform>",
                    {"camera 0.transform", "expected a last row of 0 0 0 1, found 0 0 0 2"}},
        BadDocument{"no_label", "label=\"0\" >", ">", {"camera 0.label", "expected a file name"}},
        BadDocument{"no_scale",
                    "</chunk>",
                    "<transform><scale>0</scale></transform></chunk>",
                    {"transform.scale", "above 0, found 0"}},
        BadDocument{"no_chunk", "<chunk", "<chunks", {"cameras.xml", "expected XML"}},
        BadDocument{"no_cameras",
                    "<cameras next_id=\"4\">",
                    "</chunk><chunk><cameras>",
                    {"document.chunk.cameras", "found none"}},
        BadDocument{"another_document", "document", "scene", {"cameras.xml"}}),
    [](const auto& tested) { return tested.param.name; });

TEST(Metashape, AnotherXmlIsRefused) {
  const test::TempDir folder;
  write_file(folder / "cameras.xml", "<svg/>");
  test::expect_input_error(folder.path(), {"cameras.xml", "document", "expected an element, found none"});
}

TEST(Metashape, DeepNestingIsNoDanger) {
  const test::TempDir folder;
  std::string deep;
  for (int i = 0; i < 200000; ++i) deep += "<a>";
  write_file(folder / "cameras.xml", deep);
  test::expect_input_error(folder.path(), {"cameras.xml", "expected XML"});
}

TEST(Metashape, OtherPosesArePreferredToCamerasXml) {
  const test::TempDir folder;
  write(folder.path(), ring_document(folder.path()));
  (void)test::write_transforms(folder.path());
  EXPECT_EQ(load_capture(folder.path()).format, "transforms");
  fs::remove(folder / "transforms.json");
  EXPECT_EQ(load_capture(folder.path()).format, "metashape");
}

}  // namespace
}  // namespace cnerf
