#pragma once
/// What a snapshot holds of a ColorBinEngine: the same pieces under the same names on every device.

#include <cstdint>
#include <vector>

#include "src/engine/state.h"

namespace cnerf {

/// @param features, head  parameters that append their own pieces under a prefix
template <typename Features, typename Head>
[[nodiscard]] std::vector<StatePiece> chroma_state(Features& features, Head& head, std::vector<std::int64_t>& steps) {
  std::vector<StatePiece> state;
  features.append_state("features", state);
  head.append_state("head", state);
  state.push_back(state_piece("chroma_steps", steps));
  return state;
}

}  // namespace cnerf
