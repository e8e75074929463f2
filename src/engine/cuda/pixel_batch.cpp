#include "src/engine/cuda/pixel_batch.h"

#include "src/base/check.h"

namespace cnerf {
namespace {

const char* const kAdvice = "the samples of a step; lower stage2.rays_per_patch";

}  // namespace

void PixelBatch::upload(const PixelSamples& pixels, std::size_t begin, std::size_t end, cudaStream_t stream) {
  const std::size_t first = pixels.offsets[begin], count = pixels.offsets[end] - first;
  host_offsets_.clear();
  for (std::size_t p = begin; p <= end; ++p) host_offsets_.push_back(std::uint32_t(pixels.offsets[p] - first));

  positions_.reserve(count, kAdvice);
  for (auto* buffer : {&weights_, &luminance_}) buffer->reserve(count, kAdvice);
  offsets_.reserve(host_offsets_.size(), kAdvice);
  positions_.upload(pixels.positions.data() + first, count, stream);
  weights_.upload(pixels.weights.data() + first, count, stream);
  luminance_.upload(pixels.luminance.data() + first, count, stream);
  offsets_.upload(host_offsets_.data(), host_offsets_.size(), stream);
  prepare({.pixels = std::uint32_t(end - begin),
           .positions = positions_.data(),
           .weights = weights_.data(),
           .luminance = luminance_.data(),
           .begins = offsets_.data(),
           .ends = offsets_.data() + 1},
          count, stream);
}

void PixelBatch::refer_to(const TracedBuffers& pixels, cudaStream_t stream) {
  prepare({.pixels = pixels.rays,
           .positions = pixels.positions.data(),
           .weights = pixels.weights.data(),
           .luminance = pixels.luminance.data(),
           .begins = pixels.begins.data(),
           .ends = pixels.ends.data()},
          pixels.samples, stream);
}

void PixelBatch::prepare(PixelArrays arrays, std::size_t samples, cudaStream_t stream) {
  CNERF_CHECK(samples < (std::size_t(1) << 31), "samples are counted in 32 bits");
  samples_ = std::uint32_t(samples);
  places_.reserve(samples, kAdvice);
  shares_.reserve(samples, kAdvice);
  arrays.places = places_.data();
  arrays.shares = shares_.data();
  arrays_ = arrays;
  prepare_samples(arrays_, stream);
}

const float* PixelBatch::upload_weights(std::span<const float> weights, cudaStream_t stream) {
  if (weights.empty()) {
    ones_.resize(arrays_.pixels, 1.0f);
    weights = std::span(ones_).first(arrays_.pixels);
  }
  CNERF_CHECK_EQ(weights.size(), arrays_.pixels);
  pixel_weights_.reserve(weights.size(), kAdvice);
  pixel_weights_.upload(weights.data(), weights.size(), stream);
  return pixel_weights_.data();
}

}  // namespace cnerf
