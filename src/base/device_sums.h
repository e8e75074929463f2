#pragma once
/// What several processes exchange between the memories of their GPUs.

#include <cstddef>
#include <cstdint>
#include <span>

namespace cnerf {

/// The upper half of a float.
struct Bfloat16 {
  std::uint16_t bits = 0;
};

/// All processes begin the operations in the same order, with values of the same size. They are work of a stream (a
/// cudaStream_t of the process's first GPU): no call waits for them.
class DeviceSums {
 public:
  virtual ~DeviceSums() = default;
  /// Adds up over all processes, in place; all get the same bits.
  virtual void sum(std::span<float> values, void* stream) = 0;
  virtual void sum(std::span<double> values, void* stream) = 0;
  /// Of as many equal pieces as there are processes each gets the sum of its own one, in place. What the others then
  /// hold is not defined.
  virtual void sum_own_piece(std::span<Bfloat16> values, void* stream) = 0;
  /// Everybody's own piece, likewise in place, to all.
  virtual void hand_round(std::span<std::byte> values, void* stream) = 0;
};

}  // namespace cnerf
