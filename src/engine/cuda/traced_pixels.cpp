#include "src/engine/cuda/traced_pixels.h"

#include <utility>

namespace cnerf {

RayOrder::RayOrder(const TracedBuffers& traced) : begins_(traced.rays) {
  std::vector<std::uint32_t> ends(traced.rays);
  traced.begins.download(begins_.data(), begins_.size());
  traced.ends.download(ends.data(), ends.size());
  for (std::size_t r = 0; r < ends.size(); ++r) offsets_.push_back(offsets_.back() + (ends[r] - begins_[r]));
}

TracedPixelsCuda::TracedPixelsCuda(std::shared_ptr<const TracedBuffers> buffers)
    : buffers_(std::move(buffers)), results_(buffers_->rays) {
  buffers_->results.download(results_.data(), results_.size());
}

const PixelSamples& TracedPixelsCuda::samples() const {
  if (!samples_) {
    const RayOrder order(*buffers_);
    samples_ = PixelSamples{order.downloaded(buffers_->positions), order.downloaded(buffers_->weights),
                            order.downloaded(buffers_->luminance), order.offsets()};
  }
  return *samples_;
}

}  // namespace cnerf
