#pragma once
/// Numbered pieces of a work, dealt out to the ranks one at a time, to whoever is free.

#include <cstddef>
#include <map>
#include <optional>
#include <utility>

#include "src/cluster/ranks.h"

namespace cnerf::cluster {

/// Calls `make(piece)` for each of `count` pieces on one of the ranks, and `take(piece, result)` for all in order on
/// rank 0. Alone, each result is taken as it is made, and nothing is packed.
/// @param pack, unpack  a result to bytes and back
template <typename Make, typename Take, typename Pack, typename Unpack>
void share_out(Ranks& ranks, std::size_t count, const Make& make, const Take& take, const Pack& pack,
               const Unpack& unpack) {
  if (ranks.is_alone()) {
    for (std::size_t piece = 0; piece < count; ++piece) take(piece, make(piece));
    return;
  }
  const std::int64_t work = ranks.begin_work();
  const auto next = [&] { return std::size_t(ranks.next(work)); };
  if (!ranks.is_first()) {
    for (std::size_t piece = next(); piece < count; piece = next()) {
      ranks.put(work, std::int64_t(piece), pack(make(piece)));
    }
    return;
  }
  std::map<std::size_t, decltype(make(std::size_t{}))> own;
  std::size_t taken = 0;
  const auto take_next = [&](bool waits) {
    if (const auto mine = own.find(taken); mine != own.end()) {
      take(taken, std::move(mine->second));
      own.erase(mine);
    } else {
      std::optional<Bytes> result = ranks.take(work, std::int64_t(taken), waits);
      if (!result) return false;
      take(taken, unpack(*result));
    }
    ranks.took(work);
    ++taken;
    return true;
  };
  for (std::size_t piece = next(); piece < count; piece = next()) {
    own.emplace(piece, make(piece));
    while (taken < count && take_next(own.size() > std::size_t(kMostAhead))) continue;
  }
  for (std::size_t left = count - taken; left > 0; --left) take_next(/*waits=*/true);
}

/// The same of pieces that leave files, and nothing to be handed on.
template <typename Make, typename Done>
void share_out(Ranks& ranks, std::size_t count, const Make& make, const Done& done) {
  share_out(
      ranks, count, [&](std::size_t piece) { return make(piece), 0; }, [&](std::size_t piece, int) { done(piece); },
      [](int) { return Bytes(); }, [](const Bytes&) { return 0; });
}

}  // namespace cnerf::cluster
