/// Every fuzz target over the inputs that are kept for it, and over a few mutations of them: what a build without
/// libFuzzer can do. scripts/fuzz.sh does more.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include "src/base/files.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/support/sanitizers.h"

namespace cnerf::fuzz {
namespace {
namespace fs = std::filesystem;

constexpr int kMutations = 300;                                 ///< of every input; fewer of targets that are slow
constexpr auto kPatience = std::chrono::seconds(20);            ///< with one input
constexpr auto kTimeOfTarget = std::chrono::milliseconds(500);  ///< for mutations

using Clock = std::chrono::steady_clock;

std::vector<fs::path> corpus_of(const std::string& target) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(fs::path(CNERF_SOURCE_DIR) / "tests" / "fuzz" / "corpus" / target)) {
    files.push_back(entry.path());
  }
  std::ranges::sort(files);
  return files;
}

class Mutator {
 public:
  explicit Mutator(std::uint64_t seed) : random_(seed) {}

  [[nodiscard]] std::vector<std::byte> mutation_of(std::vector<std::byte> input) {
    for (int changes = 1 + int(below(4)); changes > 0; --changes) change(input);
    return input;
  }

 private:
  std::size_t below(std::size_t end) { return std::size_t(random_()) % std::max<std::size_t>(end, 1); }

  void change(std::vector<std::byte>& bytes) {
    static constexpr std::uint64_t kNumbers[] = {0, 1, 0x7f, 0x80, 0xff, 0x7fff, 0xffff, 0x7fffffff, 0x80000000, ~0ull};
    const std::size_t at = below(bytes.size());
    const auto place = bytes.begin() + std::ptrdiff_t(at);
    const std::size_t length = std::min(below(16), bytes.size() - at);
    switch (bytes.empty() ? 3 : below(6)) {
      case 0:
        *place ^= std::byte(1u << below(8));
        break;
      case 1:
        *place = std::byte(below(256));
        break;
      case 2:
        bytes.erase(place, place + std::ptrdiff_t(length));
        break;
      case 3:
        bytes.insert(place, 1 + below(8), std::byte(below(256)));
        break;
      case 4: {
        const std::uint64_t number = kNumbers[below(std::size(kNumbers))];
        std::memcpy(bytes.data() + at, &number, std::min(bytes.size() - at, std::size_t(1) << below(4)));
        break;
      }
      default: {
        const std::vector<std::byte> copy(place, place + std::ptrdiff_t(length));
        const auto to = bytes.begin() + std::ptrdiff_t(below(bytes.size()));
        bytes.insert(to, copy.begin(), copy.end());
      }
    }
  }

  std::mt19937_64 random_;
};

/// What stands against the target after this input; empty: nothing.
std::string fault_of(const Target& target, Bytes input) {
  const auto begin = Clock::now();
  try {
    target.run(input);
  } catch (const std::exception& failure) {
    return failure.what();
  }
  return Clock::now() - begin > kPatience ? "it took more than 20 s" : "";
}

/// An input as it can be pasted.
std::string quoted(Bytes input) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const std::byte byte : input.first(std::min<std::size_t>(input.size(), 4096))) {
    text += kDigits[std::to_integer<unsigned>(byte) >> 4];
    text += kDigits[std::to_integer<unsigned>(byte) & 15];
  }
  return text;
}

class FuzzTargets : public testing::TestWithParam<Target> {
 protected:
  static void SetUpTestSuite() {
    if (test::kIsSanitized) return;
    constexpr rlim_t kMostMemory = rlim_t(8) << 30;  // address space: libraries map much of it
    rlimit now{};
    ::getrlimit(RLIMIT_AS, &now);
    now.rlim_cur = std::min(kMostMemory, now.rlim_max);
    ::setrlimit(RLIMIT_AS, &now);
  }
};

TEST_P(FuzzTargets, TakeOrRefuseKeptInputs) {
  const Target& target = GetParam();
  const auto corpus = corpus_of(target.name);
  ASSERT_FALSE(corpus.empty());
  for (const fs::path& file : corpus) EXPECT_EQ(fault_of(target, read_binary_file(file)), "") << file;
  EXPECT_EQ(fault_of(target, {}), "") << "no bytes at all";
}

TEST_P(FuzzTargets, TakeOrRefuseMutations) {
  const Target& target = GetParam();
  Mutator mutator(7);
  std::vector<std::vector<std::byte>> corpus;
  for (const fs::path& file : corpus_of(target.name)) corpus.push_back(read_binary_file(file));
  const auto end = Clock::now() + kTimeOfTarget;
  for (int round = 0; round < kMutations && Clock::now() < end; ++round) {
    for (const auto& input : corpus) {
      const auto mutation = mutator.mutation_of(input);
      ASSERT_EQ(fault_of(target, mutation), "") << "input in hex: " << quoted(mutation);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, FuzzTargets, testing::ValuesIn(targets()),
                         [](const auto& each) { return std::string(each.param.name); });

TEST(FuzzCorpus, BelongsToTargets) {
  std::vector<std::string> names, folders;
  for (const Target& target : targets()) names.emplace_back(target.name);
  std::uintmax_t bytes = 0;
  for (const auto& entry : fs::recursive_directory_iterator(fs::path(CNERF_SOURCE_DIR) / "tests" / "fuzz" / "corpus")) {
    if (entry.is_directory()) folders.push_back(entry.path().filename().string());
    if (entry.is_regular_file()) bytes += entry.file_size();
  }
  EXPECT_THAT(names, testing::UnorderedElementsAreArray(folders));
  EXPECT_LT(bytes, 300'000u);
}

}  // namespace
}  // namespace cnerf::fuzz
