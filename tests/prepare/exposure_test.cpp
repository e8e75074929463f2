#include "src/prepare/exposure.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "src/base/rng.h"

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

}  // namespace
}  // namespace cnerf::prepare
