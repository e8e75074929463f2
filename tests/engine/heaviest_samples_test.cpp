// What is left out of a ray, and what it counts as.

#include "src/engine/heaviest_samples.h"

#include <gtest/gtest.h>

namespace cnerf {
namespace {

using Samples = std::vector<WeightedSample>;

Samples of_weights(std::initializer_list<float> weights) {
  Samples samples;
  for (const float weight : weights) samples.push_back({float(samples.size()), weight, 0});
  return samples;
}
float opacity(const Samples& samples) {
  float sum = 0;
  for (const WeightedSample& sample : samples) sum += sample.weight;
  return sum;
}
Samples kept(Samples samples, const RenderEffort& effort) {
  std::vector<std::size_t> offsets = {0, samples.size()};
  keep_heaviest(effort, samples, offsets);
  EXPECT_EQ(offsets, (std::vector<std::size_t>{0, samples.size()}));
  return samples;
}

TEST(HeaviestSamples, CarryTheRaysOpacityInOrder) {
  const Samples few = kept(of_weights({0.02f, 0.4f, 0.01f, 0.3f}), {1e-3f, 0.9f});
  ASSERT_EQ(few.size(), 2u);
  EXPECT_EQ(few[0].t, 1);
  EXPECT_EQ(few[1].t, 3);
  EXPECT_NEAR(opacity(few), 0.73f, 1e-6f);
  EXPECT_EQ(kept(of_weights({0.02f, 0.4f, 0, 0.3f}), {1e-3f, 1}).size(), 4u);
}

TEST(HeaviestSamples, OfARayThatEndedEarlyAreOpaque) {
  for (const float share : {1.0f, 0.9f}) {
    EXPECT_NEAR(opacity(kept(of_weights({0.5f, 0.4f, 0.08f}), {0.03f, share})), 1, 1e-6f) << "0.02 is left";
    EXPECT_NEAR(opacity(kept(of_weights({0.5f, 0.4f, 0.06f}), {0.03f, share})), 0.96f, 1e-6f) << "it left the box";
  }
}

TEST(HeaviestSamples, OfNothingAreNone) {
  EXPECT_TRUE(kept({}, {1e-3f, 0.9f}).empty());
  EXPECT_TRUE(kept(of_weights({0, 0}), {1e-3f, 0.9f}).empty());
  EXPECT_EQ(opacity(kept(of_weights({0, 0}), {1e-3f, 1})), 0);
  Samples samples = of_weights({0.5f, 0.25f});
  std::vector<std::size_t> offsets = {0, 1, 1, 2};  // a ray without samples between two others
  keep_heaviest(RenderEffort{1e-3f, 0.9f}, samples, offsets);
  EXPECT_EQ(offsets, (std::vector<std::size_t>{0, 1, 1, 2}));
}

}  // namespace
}  // namespace cnerf
