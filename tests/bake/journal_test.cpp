#include "bake/out_of_core/journal.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <array>
#include <atomic>
#include <chrono>
#include <fstream>
#include <future>
#include <numeric>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/parallel.h"
#include "tests/cluster/fake_channel.h"
#include "tests/support/data.h"

namespace cnerf::bake::test {
namespace {
namespace fs = std::filesystem;

std::vector<int> numbers(int count) {
  std::vector<int> made(static_cast<std::size_t>(count));
  std::iota(made.begin(), made.end(), count);
  return made;
}

std::vector<int> never_made() {
  ADD_FAILURE() << "a finished part was made again";
  return {};
}

/// One part, by itself.
template <typename Make>
std::vector<int> part(Journal& journal, std::size_t number, const Make& make) {
  std::vector<int> made;
  journal.parts<int>(
      number, 1, 1, [&](std::size_t) { return make(); }, [&](std::size_t, const std::vector<int>& it) { made = it; });
  return made;
}

/// Parts of 0, 10, 20, ... numbers.
void fill(const fs::path& file, std::size_t parts) {
  Journal journal(file, "one bake");
  for (std::size_t p = 0; p < parts; ++p) {
    (void)part(journal, p, [p] { return numbers(10 * int(p)); });
  }
}

TEST(Journal, FinishedPartsAreReadNotMade) {
  const cnerf::test::TempDir folder;
  fill(folder / "j", 4);
  Journal journal(folder / "j", "one bake");
  EXPECT_EQ(journal.found(), 4u);
  EXPECT_EQ(part(journal, 3, never_made), numbers(30));
  EXPECT_EQ(part(journal, 0, never_made), numbers(0));
  EXPECT_EQ(part(journal, 4, [] { return numbers(40); }), numbers(40));
  EXPECT_EQ(journal.size(), 5u);
}

TEST(Journal, PartsMadeAtTheSameTimeAreUsedInOrderAndLieAsIfMadeOneByOne) {
  const cnerf::test::TempDir folder;
  fill(folder / "one by one", 11);
  fill(folder / "together", 3);
  {
    Journal journal(folder / "together", "one bake");
    std::atomic<int> made = 0;
    std::vector<std::size_t> used;
    journal.parts<int>(
        1, 10, 4,
        [&](std::size_t i) {
          ++made;
          return numbers(10 * int(i + 1));
        },
        [&](std::size_t i, const std::vector<int>& part) {
          EXPECT_EQ(part, numbers(10 * int(i + 1)));
          used.push_back(i);
        });
    EXPECT_EQ(made, 8) << "parts 1 and 2 were there";
    EXPECT_TRUE(std::is_sorted(used.begin(), used.end()));
    EXPECT_EQ(used.size(), 10u);
  }
  EXPECT_EQ(read_binary_file(folder / "together"), read_binary_file(folder / "one by one"));
}

TEST(Journal, APartThatFailsKeepsThoseBeforeIt) {
  const cnerf::test::TempDir folder;
  {
    Journal journal(folder / "j", "one bake");
    const auto make = [](std::size_t i) {
      if (i == 5) throw InputError("bad part");
      return numbers(int(i));
    };
    EXPECT_THROW(journal.parts<int>(0, 8, 3, make, [](std::size_t, const std::vector<int>&) {}), InputError);
  }
  EXPECT_EQ(Journal(folder / "j", "one bake").found(), 5u);
}

/// While `use` of a part is still at work, the next ones are made; what is made then is kept, should `use` fail.
TEST(Journal, PartsAreMadeWhileThoseBeforeAreUsed) {
  const cnerf::test::TempDir folder;
  {
    Journal journal(folder / "j", "one bake");
    std::promise<void> next_is_made;
    const auto make = [&](std::size_t i) {
      if (i == 1) next_is_made.set_value();
      return numbers(int(i));
    };
    const auto use = [&](std::size_t i, const std::vector<int>&) {
      if (i > 0) return;
      EXPECT_EQ(next_is_made.get_future().wait_for(std::chrono::seconds(60)), std::future_status::ready);
      throw Interrupted("stopped");
    };
    EXPECT_THROW(journal.parts<int>(0, 8, 1, make, use), Interrupted);
  }
  EXPECT_EQ(Journal(folder / "j", "one bake").found(), 2u);
}

TEST(Journal, SeveralThreadsReadAtTheSameTime) {
  const cnerf::test::TempDir folder;
  constexpr std::size_t kParts = 200;
  fill(folder / "j", kParts);
  const Journal journal(folder / "j", "one bake");
  std::atomic<int> wrong = 0;
  set_thread_count(4);
  parallel_tasks(8 * kParts, [&](std::size_t task) {
    const std::size_t part = (7 * task) % kParts;
    wrong += journal.read<int>(part) == numbers(10 * int(part)) ? 0 : 1;
  });
  set_thread_count(0);
  EXPECT_EQ(wrong, 0);
}

TEST(Journal, AnotherBakeBeginsAnew) {
  const cnerf::test::TempDir folder;
  fill(folder / "j", 4);
  const Journal journal(folder / "j", "another bake");
  EXPECT_EQ(journal.size(), 0u);
  EXPECT_EQ(Journal(folder / "j", "another bake").found(), 0u);
}

TEST(Journal, WhateverIsCutOffIsDroppedAndTheRestStays) {
  const cnerf::test::TempDir folder;
  fill(folder / "whole", 4);
  const auto whole = read_binary_file(folder / "whole");
  std::size_t most = 0;
  for (std::size_t bytes = 0; bytes <= whole.size(); ++bytes) {
    write_file(folder / "cut", std::span(whole).first(bytes));
    Journal journal(folder / "cut", "one bake");
    ASSERT_GE(journal.found(), most) << bytes;
    most = journal.found();
    for (std::size_t p = 0; p < journal.found(); ++p) ASSERT_EQ(journal.read<int>(p), numbers(10 * int(p)));
    if (bytes % 16 != 0) continue;
    for (std::size_t p = 0; p < 4; ++p) {
      (void)part(journal, p, [p] { return numbers(10 * int(p)); });
    }
    ASSERT_EQ(read_binary_file(folder / "cut"), whole) << bytes;
  }
  EXPECT_EQ(most, 4u);
}

TEST(Journal, DamagedPartsAreDropped) {
  const cnerf::test::TempDir folder;
  fill(folder / "whole", 4);
  auto bytes = read_binary_file(folder / "whole");
  bytes[bytes.size() - 1] ^= std::byte{1};
  write_file(folder / "damaged", bytes);
  EXPECT_EQ(Journal(folder / "damaged", "one bake").found(), 3u);
}

TEST(Journal, PartsOfAnotherPlaceAreNotTaken) {
  const cnerf::test::TempDir folder;
  fill(folder / "j", 3);
  auto bytes = read_binary_file(folder / "j");
  {  // the last two parts, 10 and 20 numbers behind a header of 16 bytes each, change places
    const std::size_t second = 16 + 40, third = 16 + 80;
    std::rotate(bytes.end() - std::ptrdiff_t(second + third), bytes.end() - std::ptrdiff_t(third), bytes.end());
  }
  write_file(folder / "turned", bytes);
  EXPECT_EQ(Journal(folder / "turned", "one bake").found(), 1u);
}

TEST(Journal, WhatIsReadIsWhatThisBakeWrote) {
  const cnerf::test::TempDir folder;
  Journal journal(folder / "j", "one bake");
  (void)part(journal, 0, [] { return numbers(10); });
  { Journal(folder / "j", "another bake"); }  // whoever takes no lock
  EXPECT_THROW((void)journal.read<int>(0), JournalError);
}

TEST(Journal, PartsThatAreNotSoundAreRefusedAndARestartForgetsThem) {
  const cnerf::test::TempDir folder;
  fill(folder / "j", 3);
  Journal journal(folder / "j", "one bake");
  struct Three {
    std::byte bytes[3];
  };
  EXPECT_THROW((void)journal.read<Three>(1), JournalError) << "40 bytes are no list of 3";
  const auto make = [](std::size_t) { return never_made(); };
  const auto use = [](std::size_t i, const std::vector<int>&) { EXPECT_LT(i, 1u); };
  EXPECT_THROW(journal.parts<int>(0, 3, 1, make, use, [](std::size_t i, const auto&) { return i < 1; }), JournalError);
  journal.restart();
  EXPECT_EQ(journal.size(), 0u);
  EXPECT_EQ(Journal(folder / "j", "one bake").found(), 0u);
}

TEST(Journal, LinksAndFoldersAreNotWrittenTo) {
  const cnerf::test::TempDir folder;
  write_file(folder / "precious", std::string_view("text"));
  fs::create_symlink(folder / "precious", folder / "j");
  EXPECT_THROW(Journal(folder / "j", "one bake"), OutputError);
  EXPECT_EQ(read_text_file(folder / "precious"), "text");
  EXPECT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
  EXPECT_THROW(Journal(folder / "pipe", "one bake"), OutputError);
  EXPECT_THROW(Journal(folder.path(), "one bake"), OutputError);
}

TEST(Journal, RanksMakeEachPartOnceAndAllHoldIt) {
  const cnerf::test::TempDir folder;
  fill(folder / "j", 4);
  constexpr std::size_t kParts = 23;
  std::array<std::atomic<int>, kParts> made{};
  std::array<std::atomic<int>, 3> made_by{};
  cnerf::test::on_ranks(3, [&](cluster::Ranks& ranks) {
    Journal journal = ranks.is_first() ? Journal(folder / "j", "one bake") : Journal();
    journal.share_with(ranks);
    EXPECT_TRUE(journal.has_found_any());
    std::size_t used = 0;
    journal.parts<int>(
        0, kParts, 2,
        [&](std::size_t p) {
          ++made[p];
          ++made_by[std::size_t(ranks.rank())];
          return numbers(10 * int(p));
        },
        [&](std::size_t p, const std::vector<int>& it) {
          EXPECT_EQ(p, used++);
          EXPECT_EQ(it, numbers(10 * int(p)));
        });
    EXPECT_EQ(used, kParts);
    for (std::size_t p = 0; p < kParts; ++p) EXPECT_EQ(journal.read<int>(p), numbers(10 * int(p)));
  });
  for (std::size_t p = 0; p < kParts; ++p) EXPECT_EQ(made[p], p < 4 ? 0 : 1) << p;
  for (const std::atomic<int>& by_rank : made_by) EXPECT_GE(by_rank, 5);
  const Journal alone(folder / "j", "one bake");
  EXPECT_EQ(alone.found(), kParts);
}

TEST(Journal, PlacesThatCannotBeWrittenAreOutputErrors) {
  const cnerf::test::TempDir folder;
  std::ofstream(folder / "file") << "no folder";
  EXPECT_THROW(Journal(folder / "file" / "j", "one bake"), OutputError);
  Journal journal;
  EXPECT_THROW((void)part(journal, 1, [] { return numbers(1); }), ContractError) << "parts have an order";
  EXPECT_THROW((void)journal.read<int>(0), ContractError);
}

}  // namespace
}  // namespace cnerf::bake::test
