#include "src/field/nets.h"

#include "src/base/parallel.h"
#include "src/base/rng.h"

namespace cnerf {
namespace {

constexpr float kInitialReach = 1e-4f;

}  // namespace

std::vector<float> initial_table(const std::vector<GridLevel>& levels, std::uint64_t seed) {
  std::vector<float> table(std::size_t(total_rows(levels)) * 4);
  const CounterRng rng(seed, kTableStream);
  parallel_each(table.size(), 1 << 16,
                [&](std::size_t i) { table[i] = (2.0f * rng.uniform(i) - 1.0f) * kInitialReach; });
  return table;
}

std::vector<float> initial_chroma_head(std::uint64_t seed) {
  std::vector<float> weights = initial_weights({{kChromaHeadInputs, kChromaHeadOutputs}}, seed, kChromaHeadStream);
  for (float& weight : weights) weight *= 0.1f;
  return weights;
}

}  // namespace cnerf
