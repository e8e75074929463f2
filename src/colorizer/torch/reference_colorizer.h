#pragma once
/// The colorizer behind `reference:IMAGE…` with a recipe of the caller's choice.

#include <memory>
#include <string>

#include "src/colorizer/kinds.h"
#include "src/colorizer/torch/reference_network.h"

namespace cnerf {

/// Fits a network to the images of the request's argument, or takes the weights of an earlier fit to the same images
/// with the same recipe and seed from its cache folder.
/// @throws UsageError, MissingInputError, InputError  see make_colorizer.
/// @throws Interrupted  on Ctrl-C; nothing is kept of the fit.
[[nodiscard]] std::unique_ptr<Colorizer> fit_reference_colorizer(const ColorizerRequest& request,
                                                                 const ReferenceRecipe& recipe);

}  // namespace cnerf
