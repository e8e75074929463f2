#pragma once
/// Processes that a launcher started together, and how they share work. The first one, rank 0, holds locks and writes
/// records; every rank goes through the same steps and takes its part of those that can be shared.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "src/cluster/channel.h"
#include "src/cluster/watch.h"

namespace cnerf::cluster {

inline constexpr Seconds kNoLimit{1e9};

inline constexpr std::int64_t kMostAhead = 64;  ///< pieces of a work whose results wait for rank 0

/// All operations but `next`, `put`, `take`, `took`, `announce` and `await` are to be called by all ranks in the same
/// order. All of them
/// @throws RankError  when a rank died, stopped, failed or cannot be reached; the message names it.
class Ranks {
 public:
  virtual ~Ranks() = default;
  [[nodiscard]] virtual int rank() const { return 0; }
  [[nodiscard]] virtual int size() const { return 1; }
  [[nodiscard]] bool is_first() const { return rank() == 0; }
  [[nodiscard]] bool is_alone() const { return size() == 1; }
  /// Ranks on this machine.
  [[nodiscard]] virtual int local_size() const { return 1; }
  /// Of the machine's processors, those for this rank; 0 = as many as the system gives.
  [[nodiscard]] virtual int threads() const { return 0; }

  /// Adds up over all ranks, in place. All ranks get the same bits; the order of the sum is the back end's.
  virtual void sum(std::span<float> /*values*/) {}
  virtual void sum(std::span<double> /*values*/) {}
  /// Sums between GPUs; null where the build has none, the same on all ranks, and where ranks of this machine have to
  /// share a GPU. Who is lost is found by others than the caller, which does not wait.
  [[nodiscard]] virtual DeviceSums* device_sums() { return nullptr; }
  /// What rank 0 has, for all.
  [[nodiscard]] virtual Bytes broadcast(Bytes bytes) { return bytes; }
  /// What all have, by rank, for all.
  [[nodiscard]] virtual std::vector<Bytes> gather(Bytes bytes);
  /// Waits until all are here; an error that says for what, when the limit has passed.
  virtual void barrier(const std::string& /*what*/, Seconds /*limit*/ = kNoLimit) {}

  /// A number for a shared work, the same on all ranks.
  [[nodiscard]] virtual std::int64_t begin_work() { return 0; }
  /// The next piece of a work, from 0; each number goes to one rank.
  [[nodiscard]] virtual std::int64_t next(std::int64_t /*work*/) { return 0; }
  /// A result for rank 0. Waits while that is many pieces behind.
  virtual void put(std::int64_t /*work*/, std::int64_t /*piece*/, const Bytes& /*result*/) {}
  /// For rank 0, once: a result, if it is there. If asked, waits until it is.
  [[nodiscard]] virtual std::optional<Bytes> take(std::int64_t /*work*/, std::int64_t /*piece*/, bool /*waits*/) {
    return std::nullopt;
  }
  /// For rank 0: one more piece is dealt with.
  virtual void took(std::int64_t /*work*/) {}
  /// Tells all ranks that a piece is there; `await` returns once it is.
  virtual void announce(std::int64_t /*work*/, std::int64_t /*piece*/) {}
  virtual void await(std::int64_t /*work*/, std::int64_t /*piece*/) {}

  // In terms of the above.
  /// What rank 0 says.
  [[nodiscard]] bool agreed(bool of_rank_0);
  [[nodiscard]] std::string agreed(const std::string& of_rank_0);
  /// Whether any rank says so.
  [[nodiscard]] bool any(bool of_this);
};

/// The only process.
[[nodiscard]] Ranks& alone();

/// The others wait here until rank 0 leaves the scope, unless it leaves by an error, of which they hear otherwise.
class RanksWait {
 public:
  RanksWait(Ranks& ranks, std::string what);
  ~RanksWait() noexcept(false);
  RanksWait(const RanksWait&) = delete;
  RanksWait& operator=(const RanksWait&) = delete;

 private:
  Ranks& ranks_;
  std::string what_;
  int errors_;
};

/// How processes of a launch meet.
struct Meeting {
  Launch launch;
  const Channel& channel;
  Patience patience = {};
  Seconds limit;          ///< for all to come
  std::string name = {};  ///< of this process, for messages: "pid 17 on fermi"
  Watch::End end = {};    ///< see Watch
};

/// The ranks of a launch. Once the work is done, `leave` is to be called.
class JoinedRanks final : public Ranks {
 public:
  /// @throws RankError  naming who did not come within the limit
  explicit JoinedRanks(Meeting meeting);
  ~JoinedRanks() override;

  [[nodiscard]] int rank() const override { return meeting_.launch.rank; }
  [[nodiscard]] int size() const override { return meeting_.launch.size; }
  [[nodiscard]] int local_size() const override { return meeting_.launch.local_size; }
  [[nodiscard]] int threads() const override;
  void sum(std::span<float> values) override;
  void sum(std::span<double> values) override;
  [[nodiscard]] DeviceSums* device_sums() override { return device_sums_.get(); }
  [[nodiscard]] Bytes broadcast(Bytes bytes) override;
  [[nodiscard]] std::vector<Bytes> gather(Bytes bytes) override;
  void barrier(const std::string& what, Seconds limit = kNoLimit) override;
  [[nodiscard]] std::int64_t begin_work() override { return works_++; }
  [[nodiscard]] std::int64_t next(std::int64_t work) override;
  void put(std::int64_t work, std::int64_t piece, const Bytes& result) override;
  [[nodiscard]] std::optional<Bytes> take(std::int64_t work, std::int64_t piece, bool waits) override;
  void took(std::int64_t work) override;
  void announce(std::int64_t work, std::int64_t piece) override;
  void await(std::int64_t work, std::int64_t piece) override;

  /// Ends together with the others; with an error of this process, which they are told of.
  void leave(const std::optional<std::string>& error);

 private:
  class GuardedDeviceSums;
  template <typename Operation>
  auto guarded(const Operation& operation);
  void wait_for(const std::function<bool()>& is_there, const std::string& what, Seconds limit);
  void meet(Store& store);
  [[nodiscard]] Group& group();

  Meeting meeting_;
  std::vector<std::string> names_;
  std::unique_ptr<Store> store_;
  std::unique_ptr<Group> group_;  // once it is needed
  std::unique_ptr<DeviceSums> device_sums_;
  std::unique_ptr<Watch> watch_;
  std::int64_t works_ = 0, barriers_ = 0;
};

/// The ranks that this process works with: those of its launch once it has joined them, else `alone`.
[[nodiscard]] Ranks& world();
/// Joins the launch that started this process, if one did: loads the plug-in then. A GPU of its own is chosen by the
/// local rank.
/// @throws UsageError, DeviceError, RankError
void join_world();
/// Ends together with the other ranks: JoinedRanks::leave. To be called once, at the end of the program.
/// @return  whether there were any; libraries' threads may still wait in the network then
bool leave_world(const std::optional<std::string>& error);

}  // namespace cnerf::cluster
