#pragma once
/// What tests see of an engine through the pieces of its state: parameters, gradients, copies.

#include <algorithm>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "src/engine/luminance_engine.h"
#include "src/optim/adam.h"

namespace cnerf::test {

[[nodiscard]] inline std::span<float> floats_of(const StatePiece& piece) {
  return {reinterpret_cast<float*>(piece.bytes.data()), piece.bytes.size() / sizeof(float)};
}
[[nodiscard]] inline std::span<float> floats_of(const std::vector<StatePiece>& state, const std::string& name) {
  const auto piece = std::ranges::find(state, name, &StatePiece::name);
  if (piece == state.end()) throw std::logic_error("no state piece " + name);
  return floats_of(*piece);
}

/// A gradient, seen through Adam: the first moments after a step from moments of zero are a tenth of it.
/// @param name  of the piece of moments; a hash grid's are [rows, 8], the first ones in front
[[nodiscard]] inline std::vector<float> gradient_in(const std::vector<StatePiece>& state, const std::string& name) {
  const bool is_grid = name.ends_with("grid.moments");
  const std::span<const float> moments = floats_of(state, name);
  std::vector<float> gradient;
  for (std::size_t i = 0; i < moments.size(); ++i) {
    if (!is_grid || i % 8 < 4) gradient.push_back(moments[i] / (1 - kAdamBeta1));
  }
  return gradient;
}

/// The same of structs whose first and second moments take turns; empty where there is no such piece.
[[nodiscard]] inline std::vector<float> gradient_of_structs(const std::vector<StatePiece>& state,
                                                            const std::string& name, std::size_t numbers) {
  std::vector<float> gradient;
  if (std::ranges::find(state, name, &StatePiece::name) == state.end()) return gradient;
  const std::vector<float> both = gradient_in(state, name);
  for (std::size_t i = 0; i < both.size(); ++i) {
    if (i % (2 * numbers) < numbers) gradient.push_back(both[i]);
  }
  return gradient;
}

/// Copies the state of one engine into another, as a snapshot does.
template <typename From, typename To>
void copy_state(From& from, To& to) {
  const std::vector<StatePiece> source = from.state(), target = to.state();
  if (source.size() != target.size()) throw std::logic_error("engines of different kinds");
  for (std::size_t i = 0; i < source.size(); ++i) {
    if (source[i].name != target[i].name || source[i].bytes.size() != target[i].bytes.size()) {
      throw std::logic_error("state piece " + source[i].name + " differs in name or size");
    }
    std::ranges::copy(source[i].bytes, target[i].bytes.begin());
  }
  to.state_loaded();
}

template <typename Engine>
void forget_moments(Engine& engine) {
  for (const StatePiece& piece : engine.state()) {
    if (piece.name.find("moments") != std::string::npos) std::ranges::fill(piece.bytes, std::byte{0});
  }
  engine.state_loaded();
}

/// Gradients of stage 1's next step.
struct Stage1Gradients {
  std::vector<float> table;    ///< [rows, 4]
  std::vector<float> weights;  ///< density net, then luminance net
  std::vector<float> views;    ///< of each view: log gain, turn, shift; empty where they are not learned
  std::vector<float> lenses;   ///< of each lens, in LensCorrection's order; likewise
  StepReport report;
};
/// Leaves the engine as it was. Not for a step that updates the occupancy grid first.
[[nodiscard]] inline Stage1Gradients gradients_of_next_step(LuminanceEngine& engine) {
  engine.complete_state();
  std::vector<std::vector<std::byte>> kept;
  for (const StatePiece& piece : engine.state()) kept.emplace_back(piece.bytes.begin(), piece.bytes.end());
  forget_moments(engine);
  Stage1Gradients found;
  found.report = engine.step(1e-9f);
  engine.complete_state();
  const std::vector<StatePiece> state = engine.state();
  found.table = gradient_in(state, "grid.moments");
  for (const char* net : {"density_net", "luminance_net"}) {
    const std::vector<float> of_net = gradient_in(state, std::string(net) + ".first_moments");
    found.weights.insert(found.weights.end(), of_net.begin(), of_net.end());
  }
  found.views = gradient_of_structs(state, "views.moments", kViewNumbers);
  found.lenses = gradient_of_structs(state, "lenses.moments", kLensNumbers);
  for (std::size_t i = 0; i < kept.size(); ++i) std::ranges::copy(kept[i], state[i].bytes.begin());
  engine.state_loaded();
  return found;
}

}  // namespace cnerf::test
