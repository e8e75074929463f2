#pragma once
/// Numbers of a seeded generator: the same on every machine, which the distributions of std are not.

#include <cstddef>
#include <cstdint>
#include <random>
#include <string_view>

namespace cnerf::mutants {

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  /// Of a place in a campaign, so that each mutant can be made again alone.
  Random(std::uint64_t seed, std::string_view kind, std::size_t number) : engine_(mixed(seed, kind, number)) {}

  /// 0 to count - 1; 0 where there is nothing to choose from.
  std::size_t below(std::size_t count) { return count == 0 ? 0 : std::size_t(engine_() % count); }
  bool chance(std::size_t one_in) { return below(one_in) == 0; }
  char byte() { return char(below(256)); }
  template <typename List>
  const auto& of(const List& list) {
    return list[below(std::size(list))];
  }

 private:
  static std::uint64_t mixed(std::uint64_t seed, std::string_view kind, std::size_t number) {
    std::uint64_t hash = 0xcbf29ce484222325 ^ seed;
    for (const char c : kind) hash = (hash ^ std::uint8_t(c)) * 0x100000001b3;
    return (hash ^ number) * 0x100000001b3;
  }

  std::mt19937_64 engine_;
};

}  // namespace cnerf::mutants
