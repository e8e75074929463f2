#pragma once
/// What processes talk through. The plug-in libcnerf_cluster.so makes it of LibTorch's c10d; tests make their own.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "src/base/device_sums.h"
#include "src/cluster/launch.h"

namespace cnerf::cluster {

using Bytes = std::vector<std::byte>;
using Seconds = std::chrono::duration<double>;

/// What a store takes as one value, bytes. The one of torchrun closes the connection to whoever sends more than 8 MiB.
inline constexpr std::size_t kLargestValue = std::size_t(4) << 20;

/// Named values that all processes share. For one thread at a time; every call may throw std::exception when the
/// connection breaks, and may take forever when the network is silent.
class Store {
 public:
  virtual ~Store() = default;
  /// Of at most kLargestValue. What one process sets comes to all in the order of setting.
  virtual void set(const std::string& key, const Bytes& value) = 0;
  /// Nothing where there is no such value yet.
  [[nodiscard]] virtual std::optional<Bytes> get(const std::string& key) = 0;
  /// Adds to a count, which begins with 0.  @return  the sum
  virtual std::int64_t add(const std::string& key, std::int64_t amount) = 0;
  virtual void remove(const std::string& key) = 0;
};

/// Operations that all processes begin in the same order. Errors as for a Store.
class Group {
 public:
  virtual ~Group() = default;
  /// Adds up over all processes, in place; all get the same bits.
  virtual void sum(std::span<float> values) = 0;
  virtual void sum(std::span<double> values) = 0;
  /// Everybody gets what `from` has.
  virtual void broadcast(std::span<std::byte> bytes, int from) = 0;
};

/// What the plug-in offers: the result of its `cnerf_cluster_channel`.
struct Channel {
  /// A connection of its own to the store. The first one of rank 0 opens it, unless the launcher has one.
  /// @throws std::exception  it cannot be reached within the limit
  std::unique_ptr<Store> (*connect)(const Launch& launch, bool opens, Seconds limit);
  /// To be called by all processes.
  std::unique_ptr<Group> (*group)(const Launch& launch, Seconds limit);
  const char* description;  ///< "LibTorch 1.13.1: Gloo"
  /// To be called by all processes that have a GPU each; null where this build cannot sum on them.
  std::unique_ptr<DeviceSums> (*device_sums)(const Launch& launch, Seconds limit) = nullptr;
};

}  // namespace cnerf::cluster
