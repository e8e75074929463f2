/// Ranks, with threads for processes: what they share, and what happens when one is lost.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <set>
#include <thread>

#include "src/base/error.h"
#include "src/cluster/packing.h"
#include "src/cluster/share_out.h"
#include "tests/cluster/fake_channel.h"

namespace cnerf::cluster {
namespace {

using test::exchange;
using test::on_ranks;
using testing::HasSubstr;

Bytes packed(std::size_t value) {
  return Packer().add(value).packed();
}
std::size_t unpacked(const Bytes& bytes) {
  std::size_t value = 0;
  Unpacker(bytes).get(value);
  return value;
}

TEST(Ranks, SumsBroadcastsAndGathers) {
  on_ranks(3, [](Ranks& ranks) {
    std::vector<float> values = {float(ranks.rank()), 1.0f};
    ranks.sum(std::span(values));
    EXPECT_EQ(values, (std::vector<float>{3, 3}));
    EXPECT_EQ(ranks.agreed(std::string("by ") + std::to_string(ranks.rank())), "by 0");
    EXPECT_TRUE(ranks.agreed(ranks.is_first()));
    EXPECT_TRUE(ranks.any(ranks.rank() == 2));
    EXPECT_FALSE(ranks.any(false));
    // Of different sizes, one of them empty.
    const std::vector<Bytes> all = ranks.gather(Bytes(std::size_t(ranks.rank()), std::byte(7)));
    ASSERT_EQ(all.size(), 3u);
    for (std::size_t rank = 0; rank < 3; ++rank) EXPECT_EQ(all[rank], Bytes(rank, std::byte(7)));
    ranks.barrier("test");
  });
}

TEST(Ranks, SayHowManyShareTheirMachine) {
  EXPECT_EQ(alone().local_size(), 1);
  exchange = std::make_shared<test::Exchange>();
  Meeting meeting = test::fake_meeting(0, 1);
  meeting.launch.local_size = 4;
  JoinedRanks ranks(meeting);
  EXPECT_EQ(ranks.local_size(), 4);
  ranks.leave({});
}

/// A photograph's row of a contact sheet can have 18 MB, of which torchrun's store takes no message.
TEST(Ranks, ValuesOfAnySizeArriveAndLeaveNothing) {
  const auto value_of = [](std::size_t size) {
    Bytes value(size);
    for (std::size_t i = 0; i < size; ++i) value[i] = std::byte(i % 251);
    return value;
  };
  const std::size_t sizes[] = {
      0, 1, kLargestValue - 17, kLargestValue - 16, kLargestValue - 15, 2 * kLargestValue, 5 * kLargestValue / 2};
  on_ranks(2, [&](Ranks& ranks) {
    for (const std::size_t size : sizes) {
      EXPECT_TRUE(ranks.broadcast(ranks.is_first() ? value_of(size) : Bytes()) == value_of(size)) << size;
      const std::int64_t work = ranks.begin_work();
      if (!ranks.is_first()) {
        ranks.put(work, 0, value_of(size));
      } else {
        const std::optional<Bytes> taken = ranks.take(work, 0, /*waits=*/true);
        ASSERT_TRUE(taken.has_value());
        EXPECT_TRUE(*taken == value_of(size)) << size;
        ranks.took(work);
      }
    }
  });
  for (const auto& [key, value] : exchange->values) {
    EXPECT_EQ(key.find("result"), std::string::npos) << key << " was taken and is still there";
  }
}

TEST(Ranks, AnAnnouncedPieceIsThereForAll) {
  std::atomic<int> made = 0;
  on_ranks(3, [&](Ranks& ranks) {
    const std::int64_t work = ranks.begin_work();
    if (ranks.rank() == 2) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      made = 1;
      ranks.announce(work, 7);
    }
    ranks.await(work, 7);
    EXPECT_EQ(made, 1);
  });
}

/// Sums in memory that plays a GPU's.
class FakeDeviceSums final : public DeviceSums {
 public:
  FakeDeviceSums(int rank, int size) : group_(rank, size) {}
  void sum(std::span<float> values, void* stream) override {
    EXPECT_EQ(stream, nullptr);
    group_.sum(values);
  }
  void sum(std::span<double> values, void*) override { group_.sum(values); }
  void sum_own_piece(std::span<Bfloat16>, void*) override { throw std::runtime_error("connection reset"); }
  void hand_round(std::span<std::byte> values, void*) override { group_.broadcast(values, 1); }

 private:
  test::FakeGroup group_;
};

TEST(Ranks, SumOnDevicesWhereTheChannelCan) {
  static const Channel channel = [] {
    Channel with_devices = test::fake_channel();
    with_devices.device_sums = [](const Launch& launch, Seconds) -> std::unique_ptr<DeviceSums> {
      return std::make_unique<FakeDeviceSums>(launch.rank, launch.size);
    };
    return with_devices;
  }();
  on_ranks(2, [](Ranks& ranks) { EXPECT_EQ(ranks.device_sums(), nullptr); });
  EXPECT_EQ(alone().device_sums(), nullptr);
  exchange = std::make_shared<test::Exchange>();
  std::vector<std::jthread> threads;
  for (int rank = 0; rank < 2; ++rank) {
    threads.emplace_back([rank] {
      const Meeting plain = test::fake_meeting(rank, 2);
      const Patience short_one{Seconds(0.05), Seconds(2), Seconds(5)};  // what breaks is waited for
      JoinedRanks ranks({plain.launch, channel, short_one, plain.limit, plain.name, plain.end});
      ASSERT_NE(ranks.device_sums(), nullptr);
      DeviceSums& sums = *ranks.device_sums();
      std::vector<float> values = {float(rank), 2};
      sums.sum(values, nullptr);
      EXPECT_EQ(values, (std::vector<float>{1, 4}));
      std::vector<std::byte> bytes = {std::byte(rank), std::byte(7)};
      sums.hand_round(bytes, nullptr);
      EXPECT_EQ(bytes, (std::vector<std::byte>{std::byte(1), std::byte(7)}));
      EXPECT_THROW(sums.sum_own_piece({}, nullptr), RankError) << "what breaks is told in the ranks' words";
      ranks.leave({});
    });
  }
}

/// A message is of the same program, or of nobody; it never takes more memory than it has bytes.
TEST(Ranks, AMessageOfAnotherProgramIsRefused) {
  struct Terabytes {
    std::byte values[std::size_t(1) << 44];
  };
  const Bytes message = Packer().add(std::size_t(8)).add(std::uint64_t(0)).packed();
  std::vector<Terabytes> values;
  EXPECT_THROW(Unpacker(message).get(values), ContractError);
  std::vector<double> numbers;
  EXPECT_THROW(Unpacker(message).get(numbers), ContractError);
}

TEST(Ranks, AloneNothingIsShared) {
  std::vector<std::size_t> taken;
  share_out(
      alone(), 3, [](std::size_t i) { return 10 * i; }, [&](std::size_t, std::size_t value) { taken.push_back(value); },
      [](std::size_t) -> Bytes { throw std::logic_error("alone nothing is packed"); },
      [](const Bytes&) -> std::size_t { throw std::logic_error("alone nothing is packed"); });
  EXPECT_EQ(taken, (std::vector<std::size_t>{0, 10, 20}));
  EXPECT_TRUE(alone().agreed(true));
  EXPECT_EQ(alone().gather(Bytes(2)).size(), 1u);
}

TEST(Ranks, EveryPieceIsMadeOnceAndTakenInOrder) {
  constexpr std::size_t kPieces = 500;  // more than may wait for rank 0
  std::mutex mutex;
  std::condition_variable came;
  std::multiset<std::size_t> made;
  std::vector<std::size_t> taken;
  std::set<int> makers;
  on_ranks(3, [&](Ranks& ranks) {
    for (int repetition = 0; repetition < 2; ++repetition) {  // two works do not mix
      share_out(
          ranks, kPieces,
          [&](std::size_t piece) {
            std::unique_lock lock(mutex);
            made.insert(piece);
            makers.insert(ranks.rank());
            came.notify_all();  // one alone could make everything before the others begin
            came.wait_for(lock, std::chrono::seconds(10), [&] { return makers.size() == 3; });
            return piece * piece;
          },
          [&](std::size_t piece, std::size_t result) {
            EXPECT_TRUE(ranks.is_first());
            EXPECT_EQ(result, piece * piece);
            taken.push_back(piece);
          },
          packed, unpacked);
    }
  });
  EXPECT_EQ(made.size(), 2 * kPieces);
  EXPECT_EQ(made.count(17), 2u);
  ASSERT_EQ(taken.size(), 2 * kPieces);
  EXPECT_TRUE(std::is_sorted(taken.begin(), taken.begin() + kPieces));
  EXPECT_EQ(makers.size(), 3u);
  // Results do not stay in the store.
  for (const auto& [key, value] : exchange->values) EXPECT_THAT(key, testing::Not(HasSubstr("result")));
}

TEST(Ranks, WhoDoesNotComeIsNamed) {
  exchange = std::make_shared<test::Exchange>();
  Meeting meeting = test::fake_meeting(0, 3);
  meeting.limit = Seconds(0.1);
  try {
    const JoinedRanks ranks(std::move(meeting));
    FAIL() << "two are missing";
  } catch (const RankError& error) {
    EXPECT_THAT(error.what(), HasSubstr("did not come within 0 s: 1, 2"));
    EXPECT_EQ(error.exit_code(), ExitCode::kRanks);
  }
}

/// An error of one rank ends the others, which say whose it was.
TEST(Ranks, AnErrorOfOneIsHeardByAll) {
  std::string heard;
  const auto work = [&](Ranks& ranks) {
    if (ranks.rank() == 1) throw OutputError("the disk is full");
    try {
      ranks.barrier("never");
    } catch (const RankError& error) {
      heard = error.what();
      throw;
    }
  };
  EXPECT_THROW(on_ranks(2, work), RankError);
  EXPECT_EQ(heard, "rank 1 (thread 1) has ended: the disk is full");
}

constexpr Patience kShort{Seconds(0.02), Seconds(0.3), Seconds(0.1)};

/// A process that stops, as a thread that shows no sign of life.
TEST(Watch, WhoStopsIsNamedAndTheProgramEnds) {
  exchange = std::make_shared<test::Exchange>();
  std::atomic<bool> has_ended = false;
  const Watch watch(std::make_unique<test::FakeStore>(), 0, {"rank 0", "rank 1 (pid 17 on fermi)"}, kShort,
                    [&](const std::string& why) {
                      EXPECT_THAT(why, HasSubstr("rank 1 (pid 17 on fermi)"));
                      has_ended = true;
                    });
  EXPECT_NO_THROW(watch.check());
  const std::string why = watch.explained("connection reset");
  EXPECT_THAT(why, HasSubstr("rank 1 (pid 17 on fermi) has shown no sign of life"));
  EXPECT_THROW(watch.check(), RankError);
  while (!has_ended) std::this_thread::yield();
  // The others read it.
  test::FakeStore store;
  EXPECT_EQ(text_of(store.get(kLostKey).value()), why);
}

TEST(Watch, WhoLivesIsLeftInPeace) {
  exchange = std::make_shared<test::Exchange>();
  const auto none = [](const std::string& why) { FAIL() << why; };
  const Patience patient{Seconds(0.02), Seconds(2), Seconds(0.1)};  // for threads that a busy machine lets wait
  const Watch first(std::make_unique<test::FakeStore>(), 0, {"rank 0", "rank 1"}, patient, none);
  const Watch second(std::make_unique<test::FakeStore>(), 1, {"rank 0", "rank 1"}, patient, none);
  // Longer than silence may last, by the beats themselves.
  test::FakeStore store;
  while (store.add("beat/0", 0) < 120 || store.add("beat/1", 0) < 120) std::this_thread::yield();
  EXPECT_FALSE(first.verdict());
  EXPECT_FALSE(second.verdict());
}

/// A cut cable: calls do not fail, they never return.
TEST(Watch, ASilentNetworkIsRankZeroOutOfReach) {
  exchange = std::make_shared<test::Exchange>();
  std::atomic<bool> has_ended = false;
  {
    const Watch watch(std::make_unique<test::FakeStore>(), 1, {"rank 0 (pid 4 on n1)", "rank 1"}, kShort,
                      [&](const std::string&) { has_ended = true; });
    exchange->change(exchange->is_silent, true);
    EXPECT_THAT(watch.explained(""), HasSubstr("rank 0 (pid 4 on n1) cannot be reached"));
    while (!has_ended) std::this_thread::yield();
  }  // does not wait for the network
  exchange->change(exchange->is_silent, false);
}

TEST(Watch, ABrokenConnectionIsRankZeroGone) {
  exchange = std::make_shared<test::Exchange>();
  const Watch watch(std::make_unique<test::FakeStore>(), 1, {"rank 0 (pid 4 on n1)", "rank 1"}, kShort,
                    [](const std::string&) {});
  exchange->change(exchange->is_broken, true);
  EXPECT_THAT(watch.explained(""), HasSubstr("rank 0 (pid 4 on n1) is gone"));
}

/// What is at rest neither accuses nor ends anybody.
TEST(Watch, AtRestNobodyIsMissed) {
  exchange = std::make_shared<test::Exchange>();
  Watch watch(std::make_unique<test::FakeStore>(), 0, {"rank 0", "rank 1"}, kShort,
              [](const std::string& why) { FAIL() << why; });
  watch.rest();
  EXPECT_EQ(watch.explained("the sum failed"), "the processes lost each other: the sum failed");
}

}  // namespace
}  // namespace cnerf::cluster
