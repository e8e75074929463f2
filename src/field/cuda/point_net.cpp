#include "src/field/cuda/point_net.h"

#include "src/field/cuda/channel_tiles.h"
#include "src/field/nets.h"

namespace cnerf {
namespace {

static_assert(kPointFeatures == kChromaFeatures && kPointNumbers == kChromaticityOutputs);

const char* const kColorGridAdvice = "the hash grid of colours; lower stage2.grid.log2_rows or stage2.grid.levels";
const char* const kPatchAdvice = "the samples of a step; lower stage2.rays_per_patch";

}  // namespace

PointNetCuda::PointNetCuda(const HashGridOptions& grid, PointOutputs outputs, std::uint64_t seed)
    : outputs_(outputs),
      grid_(grid, seed, kColorGridAdvice),
      net_(initial_weights(
          point_net_layout(levels(), outputs == PointOutputs::kFeatures ? kPointFeatures : kPointNumbers), seed,
          kPointNetStream)),
      packed_(point_weight_count(outputs, levels())),
      d_weights_(std::size_t(point_weight_count(outputs, levels())) * std::size_t(point_backward_blocks()), "nets") {}

void PointNetCuda::forward(const Vec3f* positions, std::uint32_t count, bool for_training, cudaStream_t stream) {
  const std::size_t points = count;
  PointForwardJob job{&grid_.levels(), grid_.table(), packed_.weights().forward, positions, count};
  if (for_training) {
    encoded_.reserve(points * std::size_t(2 * channel_tiles(levels())), kPatchAdvice);
    d_encoded_.reserve(points * std::size_t(4 * levels()), kPatchAdvice);
    job.encoded = encoded_.data();
  }
  if (outputs_ == PointOutputs::kFeatures) {
    features_.reserve(points * (kPointFeatures / 2), kPatchAdvice);
    job.features = features_.data();
  } else {
    numbers_.reserve(points, kPatchAdvice);
    job.numbers = numbers_.data();
  }
  point_forward(outputs_, job, stream);
}

void PointNetCuda::backward(const float4* places, SampleCount samples, const PointGradient& gradient,
                            cudaStream_t stream) {
  point_backward(
      outputs_,
      {levels(), packed_.weights(), samples, encoded_.data(), places, gradient, d_encoded_.data(), d_weights_.data()},
      stream);
  if (samples.most > 0) grid_.backward(places, samples, d_encoded_.data(), stream);
}

void PointNetCuda::update_net(const AdamStep* adam, const float* d_weights, int parts, cudaStream_t stream) const {
  update_layers(point_layers(outputs_, levels(), net_.weights(), packed_.weights()), d_weights, parts, adam, stream);
}

void PointNetCuda::update(const AdamStep* adam, DeviceSums* others, cudaStream_t stream) const {
  int parts = point_backward_blocks();
  if (others != nullptr) {
    others->sum(grid_.gradient(), stream);
    sum_gradient_parts(d_weights_.data(), parts, point_weight_count(outputs_, levels()), *others, stream);
    parts = 1;
  }
  grid_.update(adam, stream);
  update_net(adam, d_weights_.data(), parts, stream);
}

void PointNetCuda::append_state(const std::string& prefix, std::vector<StatePiece>& state) {
  grid_.append_state(prefix + ".grid", state);
  net_.append_state(prefix + ".net", state);
}

void PointNetCuda::upload(cudaStream_t stream) const {
  grid_.upload(stream);
  net_.upload();
  update_net(nullptr, nullptr, 0, stream);
}

}  // namespace cnerf
