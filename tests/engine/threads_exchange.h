#pragma once
/// Threads that play processes which share steps.

#include <algorithm>
#include <barrier>
#include <bit>
#include <memory>
#include <span>
#include <vector>

#include "src/engine/step_share.h"
#if CNERF_CUDA_ENGINE
#include "src/base/cuda/device_memory.h"
#endif

namespace cnerf::test {

/// Exchanges of threads that play processes, through the host's memory.
class ThreadsExchange {
 public:
  explicit ThreadsExchange(int parts) : values_(std::size_t(parts)), all_are_here_(parts) {
    for (int part = 0; part < parts; ++part) on_device_.push_back(device_sums(part));
  }

  [[nodiscard]] StepShare share(int part) {
    return {part, int(values_.size()), [this, part](std::span<float> values) { sum(part, values); },
            on_device_[std::size_t(part)].get()};
  }

 private:
  template <typename Value>
  void sum(int part, std::span<Value> values) {
    values_[std::size_t(part)] = std::as_writable_bytes(values);
    all_are_here_.arrive_and_wait();
    std::vector<Value> total(values.size(), Value(0));
    for (const std::span<std::byte> of_part : values_) {
      const auto* added = reinterpret_cast<const Value*>(of_part.data());
      for (std::size_t i = 0; i < total.size(); ++i) total[i] += added[i];
    }
    all_are_here_.arrive_and_wait();
    std::ranges::copy(total, values.begin());
  }
#if CNERF_CUDA_ENGINE
  class OnDevice final : public DeviceSums {
   public:
    OnDevice(ThreadsExchange& exchange, int part) : exchange_(exchange), part_(part) {}
    void sum(std::span<float> values, void* stream) override { sum_of(values, stream); }
    void sum(std::span<double> values, void* stream) override { sum_of(values, stream); }
    void sum_own_piece(std::span<Bfloat16> values, void* stream) override {
      on_host(values, stream, [&](std::span<Bfloat16> copy) {
        std::vector<float> sums(copy.size());
        for (std::size_t i = 0; i < sums.size(); ++i) sums[i] = std::bit_cast<float>(std::uint32_t(copy[i].bits) << 16);
        exchange_.sum(part_, std::span(sums));
        // What the others' pieces hold is not defined, so it is made worthless.
        std::ranges::fill(copy, Bfloat16{0x7fc0});
        for (const float& sum : piece_of(std::span(sums))) {
          copy[std::size_t(&sum - sums.data())].bits = std::uint16_t(std::bit_cast<std::uint32_t>(sum) >> 16);
        }
      });
    }
    void hand_round(std::span<std::byte> values, void* stream) override {
      on_host(values, stream, [&](std::span<std::byte> copy) {
        exchange_.values_[std::size_t(part_)] = piece_of(copy);
        exchange_.all_are_here_.arrive_and_wait();
        auto to = copy.begin();
        for (const std::span<std::byte> piece : exchange_.values_) {
          if (&*to != piece.data()) std::ranges::copy(piece, to);
          to += std::ptrdiff_t(piece.size());
        }
        exchange_.all_are_here_.arrive_and_wait();
      });
    }

   private:
    template <typename Value>
    void sum_of(std::span<Value> values, void* stream) {
      on_host(values, stream, [&](std::span<Value> copy) { exchange_.sum(part_, copy); });
    }
    template <typename Value>
    [[nodiscard]] std::span<Value> piece_of(std::span<Value> all) const {
      const std::size_t size = all.size() / exchange_.values_.size();
      return all.subspan(std::size_t(part_) * size, size);
    }
    template <typename Value, typename Change>
    void on_host(std::span<Value> values, void* stream, const Change& change) {
      const auto queue = static_cast<cudaStream_t>(stream);
      std::vector<Value> copy(values.size());
      CNERF_CUDA(cudaMemcpyAsync(copy.data(), values.data(), values.size_bytes(), cudaMemcpyDeviceToHost, queue));
      CNERF_CUDA(cudaStreamSynchronize(queue));
      change(std::span(copy));
      CNERF_CUDA(cudaMemcpyAsync(values.data(), copy.data(), values.size_bytes(), cudaMemcpyHostToDevice, queue));
      CNERF_CUDA(cudaStreamSynchronize(queue));
    }
    ThreadsExchange& exchange_;
    int part_;
  };
  std::unique_ptr<DeviceSums> device_sums(int part) {
    return std::make_unique<OnDevice>(*this, part);
  }
#else
  static std::unique_ptr<DeviceSums> device_sums(int) {
    return nullptr;
  }
#endif

  std::vector<std::span<std::byte>> values_;
  std::barrier<> all_are_here_;
  std::vector<std::unique_ptr<DeviceSums>> on_device_;
};

}  // namespace cnerf::test
