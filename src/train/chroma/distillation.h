#pragma once
/// Distillation: the per-sample colour of a bake, fitted to the pixels' decoded colours. What is baked is what is seen.

#include "src/train/chroma/session.h"

namespace cnerf {

/// Fits the per-sample colour for as many steps as the options want.
void distill(Session& session);

/// Mean ab distance of the per-sample colour, composited, to the pixels' decoded colours.
[[nodiscard]] double bake_ab_distance(const Session& session);

}  // namespace cnerf
