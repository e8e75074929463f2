#pragma once
/// The colorizer behind `reference:IMAGE…` with a recipe of the caller's choice.

#include <memory>
#include <string>

#include "src/colorizer/colorizer.h"
#include "src/colorizer/reference_network.h"

namespace cnerf {

/// Fits a network to the images of `argument`, or takes the weights of an earlier fit to the same images with the same
/// recipe and seed from `options.cache_folder`.
/// @throws UsageError, MissingInputError, InputError  see make_colorizer.
/// @throws Interrupted  on Ctrl-C; nothing is kept of the fit.
[[nodiscard]] std::unique_ptr<Colorizer> make_reference_colorizer(const std::string& argument,
                                                                  const ColorizerOptions& options,
                                                                  const ReferenceRecipe& recipe);

}  // namespace cnerf
