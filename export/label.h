#pragma once
/// What every file of a bake says about itself.

#include "bake/provenance.h"
#include "export/options.h"

namespace cnerf::exporting {

struct Label {
  bake::Provenance provenance;
  WorldConvention world;
};

}  // namespace cnerf::exporting
