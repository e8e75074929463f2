#include "src/field/cuda/point_net.h"

#include "src/field/cuda/channel_tiles.h"
#include "src/field/nets.h"

namespace cnerf {
namespace {

static_assert(kPointFeatures == kChromaFeatures && kPointNumbers == kChromaticityOutputs);

const char* const kGridAdvice = "the hash grid of colours; lower stage2.grid.log2_rows or stage2.grid.levels";
const char* const kSampleAdvice = "the samples of a step; lower stage2.rays_per_patch";

}  // namespace

PointNetCuda::PointNetCuda(const HashGridOptions& grid, PointOutputs outputs, std::uint64_t seed)
    : outputs_(outputs), grid_(grid, seed, kGridAdvice) {
  const int numbers = outputs == PointOutputs::kFeatures ? kPointFeatures : kPointNumbers;
  net_ = TrainedNet(initial_weights(point_net_layout(levels(), numbers), seed, kPointNetStream));
  const auto weights = std::size_t(point_weight_count(outputs, levels()));
  forward_ = {weights, "nets"};
  backward_ = {weights, "nets"};
  d_weights_ = {weights * std::size_t(point_backward_blocks()), "nets"};
}

void PointNetCuda::forward(const Vec3f* positions, std::uint32_t count, bool for_training, cudaStream_t stream) {
  const std::size_t points = count;
  PointForwardJob job{&grid_.levels(), grid_.table(), reinterpret_cast<const uint2*>(forward_.data()), positions,
                      count};
  if (for_training) {
    encoded_.reserve(points * std::size_t(16 * channel_tiles(levels())), kSampleAdvice);
    d_encoded_.reserve(points * std::size_t(4 * levels()), kSampleAdvice);
    job.encoded = reinterpret_cast<uint4*>(encoded_.data());
  }
  if (outputs_ == PointOutputs::kFeatures) {
    features_.reserve(points * (kPointFeatures / 2), kSampleAdvice);
    job.features = features_.data();
  } else {
    numbers_.reserve(points * 2, kSampleAdvice);
    job.numbers = reinterpret_cast<float2*>(numbers_.data());
  }
  point_forward(outputs_, job, stream);
}

void PointNetCuda::backward(const float4* places, SampleCount samples, const OutputGradient& gradient,
                            cudaStream_t stream) {
  PointBackwardJob job{};
  job.levels = levels();
  job.weights = {reinterpret_cast<const uint2*>(forward_.data()), reinterpret_cast<const uint2*>(backward_.data())};
  job.samples = samples;
  job.encoded = reinterpret_cast<const uint4*>(encoded_.data());
  job.places = places;
  job.shares = gradient.shares;
  job.d_composited = gradient.d_composited;
  job.d_feature = gradient.d_feature;
  job.d_numbers = gradient.d_numbers;
  job.d_encoded = d_encoded_.data();
  job.d_weights = d_weights_.data();
  point_backward(outputs_, job, stream);
  if (samples.most > 0) grid_.backward(places, samples, d_encoded_.data(), stream);
}

void PointNetCuda::update_net(const AdamStep* adam, const float* d_weights, cudaStream_t stream) const {
  update_layers(point_layers(outputs_, levels(), net_.weights(), reinterpret_cast<uint2*>(forward_.data()),
                             reinterpret_cast<uint2*>(backward_.data())),
                d_weights, point_backward_blocks(), adam, stream);
}

void PointNetCuda::update(const AdamStep* adam, cudaStream_t stream) const {
  grid_.update(adam, stream);
  update_net(adam, d_weights_.data(), stream);
}

void PointNetCuda::append_state(const std::string& prefix, std::vector<StatePiece>& state) {
  grid_.append_state(prefix + ".grid", state);
  net_.append_state(prefix + ".net", state);
}

void PointNetCuda::upload(cudaStream_t stream) const {
  grid_.upload(stream);
  net_.upload();
  update_net(nullptr, nullptr, stream);
}

}  // namespace cnerf
