#include "src/prepare/exposure.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "src/base/files.h"
#include "src/base/rng.h"
#include "src/color/colorspace_math.h"
#include "src/picture/encode.h"
#include "tests/support/data.h"

namespace cnerf::prepare {
namespace {

struct Problem {
  std::vector<double> exposures;  ///< median 1
  std::vector<Sighting> sightings;
};

/// Places seen by a few views each.  @param wrong  share of sightings that show something else
Problem make_problem(int views, int places, double noise, double wrong) {
  SequentialRng rng(1, 0);
  Problem out;
  for (int v = 0; v < views; ++v) out.exposures.push_back(std::exp(0.2 * double(rng.normal())));
  std::vector<double> sorted = out.exposures;
  std::ranges::sort(sorted);
  for (double& e : out.exposures) e /= sorted[sorted.size() / 2];
  for (int p = 0; p < places; ++p) {
    const double light = std::exp(double(rng.uniform(-3, 0)));
    const int first = int(rng.below(std::uint32_t(views)));
    for (int k = 0; k < 5; ++k) {
      const int view = (first + k) % views;
      double seen = light * out.exposures[std::size_t(view)] * std::exp(noise * double(rng.normal()));
      if (rng.uniform() < wrong) seen = std::exp(double(rng.uniform(-3, 0)));
      out.sightings.push_back({view, p, seen});
    }
  }
  return out;
}

double worst(const Problem& problem) {
  const std::vector<double> found = solve_exposures(int(problem.exposures.size()), problem.sightings);
  double out = 0;
  for (std::size_t v = 0; v < found.size(); ++v)
    out = std::max(out, std::abs(std::log(found[v] / problem.exposures[v])));
  return out;
}

TEST(Exposures, AreFoundFromSharedPlaces) {
  EXPECT_LT(worst(make_problem(21, 3000, 0, 0)), 1e-3);
  EXPECT_LT(worst(make_problem(21, 3000, 0.05, 0)), 0.02);
}

TEST(Exposures, WrongSightingsDoNotPull) {
  EXPECT_LT(worst(make_problem(21, 3000, 0.03, 0.15)), 0.05);
}

TEST(Exposures, ScalingAViewScalesItsExposureAlone) {
  Problem problem = make_problem(11, 2000, 0.02, 0);
  const std::vector<double> before = solve_exposures(11, problem.sightings);
  const auto darkest = std::size_t(std::ranges::min_element(before) - before.begin());  // the median does not move
  for (Sighting& seen : problem.sightings) seen.light *= seen.view == int(darkest) ? 0.5 : 1;
  const std::vector<double> after = solve_exposures(11, problem.sightings);
  for (std::size_t v = 0; v < 11; ++v) EXPECT_NEAR(after[v] / before[v], v == darkest ? 0.5 : 1, 0.02) << v;
}

TEST(Exposures, HazeIsToldFromExposure) {
  Problem problem = make_problem(21, 4000, 0.01, 0.05);
  std::vector<double> haze;
  for (int v = 0; v < 21; ++v) haze.push_back(v % 4 == 0 ? 0.0 : 0.01 * (v % 7));
  for (Sighting& seen : problem.sightings) seen.light += haze[std::size_t(seen.view)];
  const std::vector<ViewLight> found = solve_exposures_and_haze(21, problem.sightings);
  for (std::size_t v = 0; v < found.size(); ++v) {
    EXPECT_NEAR(found[v].exposure / problem.exposures[v], 1, 0.02) << v;
    EXPECT_NEAR(found[v].haze, haze[v], 0.005) << v;
  }
}

TEST(Exposures, WithoutHazeNoneIsFound) {
  const Problem problem = make_problem(21, 4000, 0, 0);
  const std::vector<ViewLight> found = solve_exposures_and_haze(21, problem.sightings);
  for (std::size_t v = 0; v < found.size(); ++v) {
    EXPECT_NEAR(found[v].exposure / problem.exposures[v], 1, 1e-3);
    EXPECT_NEAR(found[v].haze, 0, 1e-4);
  }
}

TEST(Exposures, ViewsThatShareNothingKeepOne) {
  const std::vector<double> found = solve_exposures(3, {{0, 0, 0.5}, {1, 0, 0.5}});
  EXPECT_DOUBLE_EQ(found[2], 1);
}

/// Two pictures of one light each, and a text model of them.
class TextModel : public testing::Test {
 protected:
  TextModel() {
    for (std::size_t i = 0; i < images_.size(); ++i) {
      images_[i].name = std::to_string(i) + ".png";
      images_[i].source = images_[i].name;
      write_png(folder_ / "images" / images_[i].name, cv::Mat1b(30, 40, std::uint8_t(i == 0 ? 90 : 120)));
    }
  }
  std::optional<double> exposures_by(const std::string& first_points, const std::string& second_points) {
    const std::string pose = " 1 0 0 0 0 0 0 1 ";
    write_file(folder_ / "model/images.txt", "# two lines each\n1" + pose + "0.png\n" + first_points + "\n2" + pose +
                                                 "1.png\r\n" + second_points + "\n");
    return estimate_exposures(images_, folder_.path(), folder_ / "model", false);
  }
  test::TempDir folder_;
  std::vector<PreparedImage> images_ = std::vector<PreparedImage>(2);
};

TEST_F(TextModel, TellsExposures) {
  EXPECT_TRUE(exposures_by("5.5 6.5 7 20.5 10.5 8 3.5 3.5 -1", "5.5 6.5 7 20.5 10.5 8"));
  const auto light = [](int code) { return linear_from_srgb(code / 255.0); };
  EXPECT_NEAR(images_[1].exposure / images_[0].exposure, light(120) / light(90), 1e-3);
}

TEST_F(TextModel, WithoutPointsTellsNone) {
  EXPECT_FALSE(exposures_by("", ""));
  EXPECT_FALSE(exposures_by("3.5 3.5 -1", ""));
  EXPECT_FALSE(exposures_by("1e300 -1e300 7", "45 3 7")) << "beside the picture";
}

}  // namespace
}  // namespace cnerf::prepare
