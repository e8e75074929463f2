#include "src/cluster/ranks.h"

#include <fmt/format.h>

#include <sched.h>

#include <algorithm>
#include <exception>
#include <thread>

#include "src/base/error.h"
#include "src/cluster/packing.h"

namespace cnerf::cluster {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kGlance{2};  // between two looks into the store
constexpr Seconds kFarewell{5};                  // for the others to hear of an error

/// Those that the system lets this process use.
int allowed_processors() {
  cpu_set_t set;
  CPU_ZERO(&set);
  return ::sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
}

std::string name_key(int rank) {
  return "name/" + std::to_string(rank);
}
std::string work_key(std::int64_t work, const std::string& what) {
  return fmt::format("work/{}/{}", work, what);
}
std::string result_key(std::int64_t work, std::int64_t piece) {
  return work_key(work, "result/" + std::to_string(piece));
}
std::string there_key(std::int64_t work, std::int64_t piece) {
  return work_key(work, "there/" + std::to_string(piece));
}

// Values of any size: how many bytes there are, and as many of them as fit beside that; the others as values of their
// own.
constexpr std::size_t kFirstPart = kLargestValue - 2 * sizeof(std::size_t);

std::string part_key(const std::string& key, std::size_t begin) {
  return key + "/from " + std::to_string(begin);
}

void set_large(Store& store, const std::string& key, std::span<const std::byte> value) {
  for (std::size_t begin = kFirstPart; begin < value.size(); begin += kLargestValue) {
    const auto part = value.subspan(begin, std::min(kLargestValue, value.size() - begin));
    store.set(part_key(key, begin), Bytes(part.begin(), part.end()));
  }
  const auto first = value.first(std::min(kFirstPart, value.size()));
  // Last: whoever finds it finds all.
  store.set(key, Packer().add(value.size()).add(Bytes(first.begin(), first.end())).packed());
}

std::optional<Bytes> get_large(Store& store, const std::string& key) {
  const std::optional<Bytes> first = store.get(key);
  if (!first) return std::nullopt;
  std::size_t size = 0;
  Bytes value;
  Unpacker(*first).get(size).get(value);
  while (value.size() < size) {
    const Bytes part = store.get(part_key(key, value.size())).value();
    value.insert(value.end(), part.begin(), part.end());
  }
  return value;
}

void remove_large(Store& store, const std::string& key, std::size_t size) {
  for (std::size_t begin = kFirstPart; begin < size; begin += kLargestValue) store.remove(part_key(key, begin));
  store.remove(key);
}

}  // namespace

std::vector<Bytes> Ranks::gather(Bytes bytes) {
  std::vector<Bytes> all;
  all.push_back(std::move(bytes));
  return all;
}

bool Ranks::agreed(bool of_rank_0) {
  return broadcast({std::byte(of_rank_0)}).front() != std::byte{0};
}

std::string Ranks::agreed(const std::string& of_rank_0) {
  return text_of(broadcast(bytes_of(of_rank_0)));
}

bool Ranks::any(bool of_this) {
  double count = of_this ? 1 : 0;
  sum(std::span(&count, 1));
  return count > 0;
}

Ranks& alone() {
  static Ranks one;
  return one;
}

RanksWait::RanksWait(Ranks& ranks, std::string what)
    : ranks_(ranks), what_(std::move(what)), errors_(std::uncaught_exceptions()) {}

RanksWait::~RanksWait() noexcept(false) {
  if (std::uncaught_exceptions() == errors_) ranks_.barrier(what_);
}

template <typename Operation>
auto JoinedRanks::guarded(const Operation& operation) {
  watch_->check();
  try {
    return operation();
  } catch (const Error&) {
    throw;
  } catch (const std::exception& problem) {
    throw RankError(watch_->explained(problem.what()));
  }
}

/// Those of the channel, once they are needed.
class JoinedRanks::GuardedDeviceSums final : public DeviceSums {
 public:
  explicit GuardedDeviceSums(JoinedRanks& ranks) : ranks_(ranks) {}
  void sum(std::span<float> values, void* stream) override {
    ranks_.guarded([&] { sums().sum(values, stream); });
  }
  void sum(std::span<double> values, void* stream) override {
    ranks_.guarded([&] { sums().sum(values, stream); });
  }
  void sum_own_piece(std::span<Bfloat16> values, void* stream) override {
    ranks_.guarded([&] { sums().sum_own_piece(values, stream); });
  }
  void hand_round(std::span<std::byte> values, void* stream) override {
    ranks_.guarded([&] { sums().hand_round(values, stream); });
  }

 private:
  DeviceSums& sums() {
    const Meeting& meeting = ranks_.meeting_;
    if (!sums_) sums_ = meeting.channel.device_sums(meeting.launch, meeting.limit);
    return *sums_;
  }
  JoinedRanks& ranks_;
  std::unique_ptr<DeviceSums> sums_;
};

JoinedRanks::JoinedRanks(Meeting meeting) : meeting_(std::move(meeting)) {
  const Launch& launch = meeting_.launch;
  try {
    store_ = meeting_.channel.connect(launch, /*opens=*/true, meeting_.limit);
    meet(*store_);
    watch_ = std::make_unique<Watch>(meeting_.channel.connect(launch, false, meeting_.limit), rank(), names_,
                                     meeting_.patience, meeting_.end);
    if (meeting_.channel.device_sums != nullptr) device_sums_ = std::make_unique<GuardedDeviceSums>(*this);
  } catch (const Error&) {
    throw;
  } catch (const std::exception& problem) {
    throw RankError(fmt::format("rank {} of {} ({}): rank 0 cannot be reached at {}:{}: {}", rank(), size(),
                                launch.launcher, launch.host, launch.port, problem.what()));
  }
}

JoinedRanks::~JoinedRanks() = default;

/// Everybody says who it is, and waits for the others.
void JoinedRanks::meet(Store& store) {
  const Clock::time_point start = Clock::now();
  store.set(name_key(rank()), bytes_of(fmt::format("rank {} ({})", rank(), meeting_.name)));
  std::string missing;
  for (int other = 0; other < size(); ++other) {
    std::optional<Bytes> name = store.get(name_key(other));
    while (!name && Clock::now() - start < meeting_.limit) {
      std::this_thread::sleep_for(10 * kGlance);
      name = store.get(name_key(other));
    }
    if (!name) missing += (missing.empty() ? "" : ", ") + std::to_string(other);
    names_.push_back(name ? text_of(*name) : "");
  }
  if (missing.empty()) return;
  throw RankError(fmt::format("of {} processes by {}, these ranks did not come within {:.0f} s: {}", size(),
                              meeting_.launch.launcher, meeting_.limit.count(), missing));
}

void JoinedRanks::wait_for(const std::function<bool()>& is_there, const std::string& what, Seconds limit) {
  const Clock::time_point start = Clock::now();
  while (!guarded(is_there)) {
    if (Clock::now() - start > limit) {
      throw RankError(fmt::format("{}: not all ranks came within {:.0f} s", what, limit.count()));
    }
    std::this_thread::sleep_for(kGlance);
  }
}

int JoinedRanks::threads() const {
  // A launcher that binds processes to processors has shared these out itself.
  const int given = int(std::thread::hardware_concurrency()), allowed = allowed_processors();
  return allowed < given ? 0 : std::max(1, given / local_size());
}

Group& JoinedRanks::group() {
  if (!group_) group_ = meeting_.channel.group(meeting_.launch, meeting_.limit);
  return *group_;
}

void JoinedRanks::sum(std::span<float> values) {
  guarded([&] { group().sum(values); });
}

void JoinedRanks::sum(std::span<double> values) {
  guarded([&] { group().sum(values); });
}

/// By the store: rank 0 may come hours later.
Bytes JoinedRanks::broadcast(Bytes bytes) {
  const std::string key = work_key(begin_work(), "said");
  if (is_first()) {
    guarded([&] { set_large(*store_, key, bytes); });
    return bytes;
  }
  std::optional<Bytes> said;
  wait_for([&] { return (said = get_large(*store_, key)).has_value(); }, "broadcast", kNoLimit);
  return std::move(*said);
}

std::vector<Bytes> JoinedRanks::gather(Bytes bytes) {
  barrier("gather");  // the group's operations have a limit
  std::vector<double> sizes(std::size_t(size()), 0.0);
  sizes[std::size_t(rank())] = double(bytes.size());
  sum(std::span(sizes));
  std::vector<Bytes> all(sizes.size());
  all[std::size_t(rank())] = std::move(bytes);
  for (int from = 0; from < size(); ++from) {
    Bytes& of_rank = all[std::size_t(from)];
    of_rank.resize(std::size_t(sizes[std::size_t(from)]));
    if (!of_rank.empty()) guarded([&] { group().broadcast(of_rank, from); });
  }
  return all;
}

void JoinedRanks::barrier(const std::string& what, Seconds limit) {
  const std::string key = "barrier/" + std::to_string(barriers_++);
  guarded([&] { store_->add(key, 1); });
  wait_for([&] { return store_->add(key, 0) >= size(); }, what, limit);
}

std::int64_t JoinedRanks::next(std::int64_t work) {
  return guarded([&] { return store_->add(work_key(work, "next"), 1); }) - 1;
}

void JoinedRanks::put(std::int64_t work, std::int64_t piece, const Bytes& result) {
  wait_for([&] { return piece - store_->add(work_key(work, "taken"), 0) < kMostAhead; }, "result", kNoLimit);
  guarded([&] { set_large(*store_, result_key(work, piece), result); });
}

std::optional<Bytes> JoinedRanks::take(std::int64_t work, std::int64_t piece, bool waits) {
  const std::string key = result_key(work, piece);
  std::optional<Bytes> result = guarded([&] { return get_large(*store_, key); });
  if (!result && waits) {
    wait_for([&] { return (result = get_large(*store_, key)).has_value(); }, "result", kNoLimit);
  }
  if (result) guarded([&] { remove_large(*store_, key, result->size()); });
  return result;
}

void JoinedRanks::took(std::int64_t work) {
  guarded([&] { store_->add(work_key(work, "taken"), 1); });
}

void JoinedRanks::announce(std::int64_t work, std::int64_t piece) {
  guarded([&] { store_->add(there_key(work, piece), 1); });
}

void JoinedRanks::await(std::int64_t work, std::int64_t piece) {
  wait_for([&] { return store_->add(there_key(work, piece), 0) > 0; }, "a piece of work", kNoLimit);
}

void JoinedRanks::leave(const std::optional<std::string>& error) {
  if (!error) barrier("end");
  // Where somebody is lost the store may be silent; only rank 0's own is sure to answer.
  if (!is_first() && watch_->verdict()) return watch_->rest();
  try {
    if (error && !watch_->verdict()) {
      store_->set(kLostKey, bytes_of(names_[std::size_t(rank())] + " has ended: " + *error));
    }
    store_->add("gone", 1);
    watch_->rest();
    // The store goes with rank 0.
    const Clock::time_point start = Clock::now();
    while (is_first() && store_->add("gone", 0) < size() && Clock::now() - start < kFarewell) {
      std::this_thread::sleep_for(10 * kGlance);
    }
  } catch (const std::exception&) {
    watch_->rest();  // nobody is there to be told
  }
}

}  // namespace cnerf::cluster
