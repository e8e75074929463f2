#pragma once
/// The functions behind TorchBaselines.

#include "src/compare/baselines/torch_plugin.h"

namespace cnerf::compare {

[[nodiscard]] std::unique_ptr<Engines> make_positional_engines(const PositionalRays& rays, const Engines& others);
[[nodiscard]] std::unique_ptr<StyleNetwork> make_style_network(const std::filesystem::path& network,
                                                               const LabPicture& reference);

}  // namespace cnerf::compare
