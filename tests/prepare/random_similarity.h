#pragma once
/// Points and similarities by lot.

#include <cmath>

#include "src/base/rng.h"
#include "src/prepare/similarity.h"

namespace cnerf::test {

inline Vec3d random_vector(SequentialRng& rng) {
  return {double(rng.normal()), double(rng.normal()), double(rng.normal())};
}

inline Mat3d random_rotation(SequentialRng& rng) {
  return prepare::rotation_between(normalized(random_vector(rng)), normalized(random_vector(rng))) *
         prepare::rotation_between(normalized(random_vector(rng)), normalized(random_vector(rng)));
}

inline prepare::Similarity random_similarity(SequentialRng& rng) {
  return {std::exp(double(rng.normal())), random_rotation(rng), random_vector(rng) * 10.0};
}

}  // namespace cnerf::test
