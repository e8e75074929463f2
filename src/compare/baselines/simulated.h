#pragma once
/// A colorizer that knows the true colours and errs on purpose, as real ones do: it makes claims about a method
/// testable without anybody's weights. Only evaluation makes one; no spec of `make_colorizer` leads here, so that
/// colours cannot reach an ordinary training.

#include <memory>

#include "src/capture/capture.h"
#include "src/colorizer/colorizer.h"

namespace cnerf::compare {

/// How the true ab of a question is disturbed. Every query draws anew, by its number, so the same question about the
/// same place of the same view has another answer each time it is asked, and the same one when a run is resumed.
struct SimulationOptions {
  double hue = 25;          ///< degrees; the answer's hues turn by as much as this, uniformly
  double desaturate = 0.2;  ///< the answer's chroma shrinks by up to this share, uniformly
  double modes = 0.25;      ///< share of answers in a second mode, washed out and brownish
  double bias = 10;         ///< degrees; hues are off by up to this as a function of the content, in every answer alike
  double outliers = 0.15;   ///< share of answers that are wrong altogether: hues turned by 90 to 270 degrees and a cast
  int seed = 1;
};

/// Without any disturbance: the true colours as an answer, the upper bound of every method.
[[nodiscard]] constexpr SimulationOptions oracle_simulation() {
  return {0, 0, 0, 0, 0, 1};
}

/// Reads the colours of the capture's training views, at no more than `kTruthSide` pixels of the short side.
/// Its answers are ab values. A question without origins, or about another view, is a ColorizerError.
/// @throws InputError  when a training view has no colours.
[[nodiscard]] std::unique_ptr<Colorizer> make_simulated_colorizer(const Capture& capture,
                                                                  const SimulationOptions& options);
inline constexpr int kTruthSide = 384;
inline constexpr const char* kSimulated = "simulated";  ///< its spec, of `cnerf compare` alone

}  // namespace cnerf::compare
