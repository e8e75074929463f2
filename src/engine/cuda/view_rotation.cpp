#include "src/engine/cuda/view_rotation.h"

#include <algorithm>
#include <cstring>
#include <numeric>

#include "src/base/byte_count.h"
#include "src/base/error.h"
#include "src/base/rng.h"

namespace cnerf {
namespace {

constexpr long kStepsOfTurn = 8;
constexpr std::size_t kAlignment = 256;

const char* const kAdvice = "the training images; lower image_memory";

std::size_t aligned(std::size_t bytes) {
  return (bytes + kAlignment - 1) / kAlignment * kAlignment;
}

/// Of the largest view, with its planes aligned.
std::size_t largest_slot(const std::vector<TrainingView>& views) {
  constexpr std::size_t kPlanes = 4;
  std::size_t most = 0;
  for (const TrainingView& view : views) most = std::max(most, pixel_bytes(view));
  return aligned(most) + kPlanes * kAlignment;
}

/// All views in an order that has nothing to do with the one in which they were taken.
std::vector<std::size_t> shuffled(std::size_t count) {
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), std::size_t(0));
  const CounterRng rng(named_stream("turn"), 0);
  for (std::size_t i = count; i > 1; --i) std::swap(order[i - 1], order[rng.below(i, std::uint32_t(i))]);
  return order;
}

}  // namespace

ViewRotation::ViewRotation(std::vector<TrainingView> views, std::size_t memory, ViewRecord* records)
    : views_(std::move(views)),
      order_(shuffled(views_.size())),
      records_(records),
      slot_bytes_(largest_slot(views_)),
      slots_(std::min(long(memory / slot_bytes_), long(views_.size()))) {
  constexpr long kFewest = 3;
  if (slots_ < kFewest) {
    throw DeviceError("image_memory, or what the GPU has free: " + in_words(memory) +
                      " is too little for steps to choose from; at least " + in_words(kFewest * slot_bytes_) +
                      " are needed, for " + std::to_string(kFewest) + " views");
  }
  memory_ = DeviceBuffer<std::uint8_t>(std::size_t(slots_) * slot_bytes_, kAdvice);
  resident_ = DeviceBuffer<std::uint32_t>(std::size_t(slots_ - 1), kAdvice);
  CNERF_CUDA(cudaHostAlloc(reinterpret_cast<void**>(&staging_), slot_bytes_, cudaHostAllocDefault));
}

ViewRotation::~ViewRotation() {
  if (copying_.valid()) copying_.wait();
  cudaStreamSynchronize(copies_);
  cudaFreeHost(staging_);
}

std::vector<std::size_t> ViewRotation::views_of_step(long step, std::size_t views, long resident) {
  const std::vector<std::size_t> order = shuffled(views);
  std::vector<std::size_t> found(static_cast<std::size_t>(resident));
  const long first = step / kStepsOfTurn;
  for (long turn = first; turn < first + resident; ++turn) {
    found[std::size_t(turn % resident)] = order[std::size_t(turn) % views];
  }
  return found;
}

std::size_t ViewRotation::view_at(long turn) const {
  return order_[std::size_t(turn) % order_.size()];
}

/// Copies beside the caller: pixels may have to be read from a file first.
void ViewRotation::start_copy(long turn) {
  copying_ = std::async(std::launch::async, [this, turn] {
    const std::size_t slot = std::size_t(turn % slots_) * slot_bytes_;
    std::size_t used = 0;
    const PlacePlane place = [&](const void* data, std::size_t bytes) -> const std::uint8_t* {
      if (bytes == 0) return nullptr;
      const std::size_t at = std::exchange(used, used + aligned(bytes));
      std::memcpy(staging_ + at, data, bytes);
      return memory_.data() + slot + at;
    };
    PlacedView placed;
    placed.view = std::uint32_t(view_at(turn));
    copied_.wait();  // the staging memory is free
    place_pixels(views_[placed.view], place, placed);
    free_.hold(copies_);
    CNERF_CUDA(cudaMemcpyAsync(memory_.data() + slot, staging_, used, cudaMemcpyHostToDevice, copies_));
    copied_.record(copies_);
    return placed;
  });
}

void ViewRotation::finish_copy(long turn, cudaStream_t stream) {
  const PlacedView placed = copying_.get();
  copied_.hold(stream);
  put_view(placed, records_, resident_.data() + turn % (slots_ - 1), stream);
  // From here on nothing reads the slot of the view that went, which is the next one's.
  free_.record(stream);
}

void ViewRotation::follow(long step, cudaStream_t stream) {
  const long wanted = step / kStepsOfTurn + slots_ - 1;  // turns that have come by now
  if (next_ == wanted) return;
  if (next_ < 0 || next_ + 1 != wanted) {
    if (copying_.valid()) (void)copying_.get();
    next_ = wanted - (slots_ - 1);
    free_.record(stream);
    start_copy(next_);
  }
  while (next_ < wanted) {
    finish_copy(next_, stream);
    start_copy(++next_);
  }
}

}  // namespace cnerf
