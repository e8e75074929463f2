#include "encoding/torch/hash_grid.h"

#include "encoding/cpu/hash_grid_kernels.h"
#include "src/base/aligned.h"
#include "src/base/check.h"
#include "src/base/rng.h"

namespace cnerf {
namespace {

constexpr float kInitialReach = 1e-4f;  // uniform in +-1e-4 (Mueller et al. 2022, Sec. 4)

std::size_t groups_of(std::int64_t n) {
  return (std::size_t(n) + kGroup - 1) / kGroup;
}

/// [n, C] -> [G, C, 16], padded with a legal position.
AlignedVector<float> to_groups(const torch::Tensor& samples, int channels, float padding) {
  AlignedVector<float> grouped(groups_of(samples.size(0)) * std::size_t(channels) * kGroup, padding);
  const float* from = samples.data_ptr<float>();
  for (std::size_t s = 0; s < std::size_t(samples.size(0)); ++s) {
    for (int c = 0; c < channels; ++c) {
      grouped[(s / kGroup * std::size_t(channels) + std::size_t(c)) * kGroup + s % kGroup] = *from++;
    }
  }
  return grouped;
}

struct Encode : torch::autograd::Function<Encode> {
  static torch::Tensor forward(torch::autograd::AutogradContext* context, const torch::Tensor& table,
                               const torch::Tensor& positions, const std::vector<GridLevel>* levels) {
    context->save_for_backward({positions});
    context->saved_data["levels"] = reinterpret_cast<std::int64_t>(levels);
    context->saved_data["rows"] = table.size(0);
    const int channels = 4 * int(levels->size());
    const AlignedVector<float> grouped = to_groups(positions, 3, 0.5f);
    AlignedVector<float> encoded(groups_of(positions.size(0)) * std::size_t(channels) * kGroup);
    hash_grid_kernels().encode(levels->data(), levels->size(), table.data_ptr<float>(), grouped.data(),
                               groups_of(positions.size(0)), encoded.data(), channels);
    torch::Tensor out = torch::empty({positions.size(0), channels});
    float* to = out.data_ptr<float>();
    for (std::size_t s = 0; s < std::size_t(positions.size(0)); ++s) {
      for (int c = 0; c < channels; ++c) {
        *to++ = encoded[(s / kGroup * std::size_t(channels) + std::size_t(c)) * kGroup + s % kGroup];
      }
    }
    return out;
  }

  static torch::autograd::variable_list backward(torch::autograd::AutogradContext* context,
                                                 torch::autograd::variable_list d_outputs) {
    const torch::Tensor positions = context->get_saved_variables().front();
    const auto& levels = *reinterpret_cast<const std::vector<GridLevel>*>(context->saved_data["levels"].toInt());
    const int channels = 4 * int(levels.size());
    const AlignedVector<float> grouped = to_groups(positions, 3, 0.5f);
    const AlignedVector<float> d_encoded = to_groups(d_outputs.front().contiguous(), channels, 0.0f);
    torch::Tensor d_table = torch::zeros({context->saved_data["rows"].toInt(), 4});
    for (std::size_t l = 0; l < levels.size(); ++l) {
      hash_grid_kernels().scatter_level(levels[l], grouped.data(), d_encoded.data(), groups_of(positions.size(0)),
                                        channels, 4 * int(l),
                                        d_table.data_ptr<float>() + 4 * std::size_t(levels[l].first_row));
    }
    return {d_table, torch::Tensor(), torch::Tensor()};
  }
};

}  // namespace

HashGridImpl::HashGridImpl(const HashGridOptions& options, std::uint64_t seed) : levels_(hash_grid_levels(options)) {
  torch::Tensor initial = torch::empty({std::int64_t(total_rows(levels_)), 4});
  const CounterRng rng(seed, 2469);
  float* values = initial.data_ptr<float>();
  for (std::int64_t i = 0; i < initial.numel(); ++i) {
    values[i] = (2.0f * rng.uniform(std::uint64_t(i)) - 1.0f) * kInitialReach;
  }
  table = register_parameter("table", initial);
}

torch::Tensor HashGridImpl::forward(const torch::Tensor& positions) {
  CNERF_CHECK(positions.dim() == 2 && positions.size(1) == 3, "positions are [n, 3]");
  CNERF_CHECK(positions.scalar_type() == torch::kFloat32 && positions.is_cpu(), "positions are f32 on the CPU");
  CNERF_CHECK(positions.numel() == 0 || (positions.min().item<float>() >= 0 && positions.max().item<float>() <= 1),
              "positions lie in [0, 1]");
  return Encode::apply(table, positions.contiguous(), &levels_);
}

}  // namespace cnerf
