/// PLY and SPZ as Spark, a viewer of splats for three.js, reads and draws them, against what was written.

#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <optional>

#include "export/splat_writer.h"
#include "src/base/files.h"
#include "src/base/rng.h"
#include "tests/bake/analytic_field.h"
#include "tests/export/splat_files.h"
#include "tests/support/data.h"

namespace cnerf::exporting::test {
using namespace cnerf::test;
using namespace bake::test;
namespace {
namespace fs = std::filesystem;

constexpr int kWidth = 160, kHeight = 120, kFocal = 150;

/// node_modules with the reader: under $CNERF_NODE_MODULES, else where scripts/install_dependencies.sh puts it.
std::optional<fs::path> node_modules() {
  const char* given = std::getenv("CNERF_NODE_MODULES");
  const fs::path folder = given != nullptr ? fs::path(given) : fs::path(CNERF_SOURCE_DIR) / "build/node/node_modules";
  for (const char* package : {"@sparkjsdev/spark", "three", "playwright-core"}) {
    if (!fs::exists(folder / package)) return std::nullopt;
  }
  if (std::system("node --version > /dev/null 2>&1") != 0) return std::nullopt;
  return folder;
}
std::optional<std::string> browser() {
  for (const char* path : {"/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"}) {
    if (fs::exists(path)) return path;
  }
  return std::nullopt;
}

/// Discs, needles and balls of all colours that lie in front of each other, seen by one camera.
bake::SplatCloud cloud() {
  SequentialRng rng(5, named_stream("viewer"));
  bake::SplatCloud cloud;
  for (int i = 0; i < 150; ++i) {
    bake::Splat splat;
    splat.position = {rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-0.7f, 0.7f)};
    splat.log_scale = {rng.uniform(-4, -1.5f), rng.uniform(-3, -1.5f), rng.uniform(-5, -2)};
    float square = 0;
    for (float& part : splat.rotation) square += std::pow(part = rng.normal(), 2.0f);
    for (float& part : splat.rotation) part /= std::sqrt(square);
    splat.opacity_logit = rng.uniform(-1, 4);
    splat.color = {rng.uniform(), rng.uniform(), rng.uniform()};
    for (float& part : splat.shading) part = rng.uniform(-0.35f, 0.35f);
    cloud.splats.push_back(splat);
  }
  return cloud;
}

bake::Camera camera() {
  return camera_at("camera", {0.5, -3, 0.6}, {0, 0, 0}, kWidth, kHeight, kFocal);
}

nlohmann::json camera_json() {
  const auto& [linear, centre] = camera().world_from_camera;
  nlohmann::json rows = nlohmann::json::array();
  for (int i = 0; i < 3; ++i) rows.push_back({linear.rows[i].x, linear.rows[i].y, linear.rows[i].z, centre[i]});
  rows.push_back({0, 0, 0, 1});
  return {{"width", kWidth}, {"height", kHeight}, {"focal", kFocal}, {"worldFromCamera", rows}};
}

double psnr(const std::vector<double>& rgba, const std::vector<std::byte>& rgb) {
  double sum = 0;
  for (std::size_t i = 0; i < rgb.size(); ++i) {
    sum += std::pow(std::min(1.0, rgba[i / 3 * 4 + i % 3]) - double(rgb[i]) / 255, 2);
  }
  return -10 * std::log10(sum / double(rgb.size()));
}

/// What the reader says of a splat, in the order of its row.
std::vector<double> row_of_file(const FileSplat& splat) {
  std::vector<double> row{splat.position.x, splat.position.y, splat.position.z};
  for (int axis = 0; axis < 3; ++axis) row.push_back(std::exp(splat.log_scale[axis]));
  const double sign = splat.rotation[0] < 0 ? -1 : 1;  // q and -q are one rotation
  for (const double part : splat.rotation) row.push_back(sign * part);
  row.push_back(1 / (1 + std::exp(-splat.opacity_logit)));
  for (int c = 0; c < 3; ++c) row.push_back(0.5 + 0.28209479177387814 * splat.harmonics[0][c]);
  return row;
}

class SplatViewer : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    if (!node_modules() || !browser()) return;
    folder_ = std::make_unique<TempDir>();
    write_splats(cloud(), folder_->path(), "splats", {});
    write_file(*folder_ / "camera.json", camera_json().dump());
    const std::string command = "node '" CNERF_SOURCE_DIR "/tests/splat_viewer/open_splats.mjs' '" +
                                node_modules()->string() + "' '" + *browser() + "' '" + folder_->path().string() +
                                "' > '" + (*folder_ / "log").string() + "' 2>&1";
    status_ = std::system(command.c_str());
  }
  static void TearDownTestSuite() { folder_.reset(); }
  void SetUp() override {
    if (!folder_) GTEST_SKIP() << "needs node, Spark and Chromium: bash scripts/install_dependencies.sh --tests";
    ASSERT_EQ(status_, 0) << read_text_file(*folder_ / "log");
  }

  /// @param worst  that a number may be off: the reader packs splats for the graphics card
  static void expect_read(const std::string& name, const std::vector<FileSplat>& written, double worst) {
    const auto read = nlohmann::json::parse(read_text_file(*folder_ / (name + ".json")));
    ASSERT_EQ(read.size(), written.size());
    double off = 0;
    for (std::size_t i = 0; i < written.size(); ++i) {
      const std::vector<double> expected = row_of_file(written[i]);
      const double sign = read[i][6].get<double>() < 0 ? -1 : 1;
      for (std::size_t k = 0; k < expected.size(); ++k) {
        const double is = read[i][k].get<double>() * (k >= 6 && k < 10 ? sign : 1);
        off = std::max(off, std::abs(is - expected[k]));
      }
    }
    EXPECT_LT(off, worst) << name;
  }
  static void expect_drawn(const std::string& name, const std::vector<FileSplat>& written) {
    const auto ours = reference_picture(written, camera().intrinsics, camera().world_from_camera);
    const auto drawn = read_binary_file(*folder_ / (name + ".rgb"));
    const double decibels = psnr(ours, drawn);
    RecordProperty(name, std::to_string(decibels));
    std::printf("%s: %.2f dB\n", name.c_str(), decibels);
    EXPECT_GT(decibels, 40) << name << ": the reader draws another picture than ours";
    // It would notice shading that is missing or turned around.
    for (const double factor : {0.0, -1.0}) {
      std::vector<FileSplat> other = written;
      for (FileSplat& splat : other) {
        for (std::size_t k = 1; k < splat.harmonics.size(); ++k) splat.harmonics[k] *= factor;
      }
      EXPECT_LT(psnr(reference_picture(other, camera().intrinsics, camera().world_from_camera), drawn), decibels - 3);
    }
  }

  static inline std::unique_ptr<TempDir> folder_;
  static inline int status_ = 0;
};

TEST_F(SplatViewer, ReadsThePlyAsItWasWritten) {
  expect_read("splats.ply", file_splats(cloud().splats), 0.02);
}
TEST_F(SplatViewer, ReadsTheSpzAsItWasWritten) {
  expect_read("splats.spz", read_splat_spz(*folder_ / "splats.spz"), 0.02);
}
TEST_F(SplatViewer, DrawsThePlyAsTheProgramDoes) {
  expect_drawn("splats.ply", read_splat_ply(*folder_ / "splats.ply"));
}
TEST_F(SplatViewer, DrawsTheSpzAsTheProgramDoes) {
  expect_drawn("splats.spz", read_splat_spz(*folder_ / "splats.spz"));
}

}  // namespace
}  // namespace cnerf::exporting::test
