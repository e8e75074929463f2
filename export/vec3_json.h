#pragma once
/// Points and boxes in JSON.

#include <cstddef>
#include <nlohmann/json.hpp>

#include "src/base/aabb.h"
#include "src/base/vec3.h"

namespace nlohmann {

template <typename Number>
struct adl_serializer<cnerf::Vec3<Number>> {
  template <typename Json>
  static void to_json(Json& json, const cnerf::Vec3<Number>& v) {
    json = {v.x, v.y, v.z};
  }
  template <typename Json>
  static void from_json(const Json& json, cnerf::Vec3<Number>& v) {
    if (json.size() != 3) throw Json::type_error::create(302, "expected three numbers", &json);
    for (int axis = 0; axis < 3; ++axis) json.at(std::size_t(axis)).get_to(v[axis]);
  }
};

template <>
struct adl_serializer<cnerf::Aabbd> {
  template <typename Json>
  static void to_json(Json& json, const cnerf::Aabbd& box) {
    json = {{"min", box.min}, {"max", box.max}};
  }
  template <typename Json>
  static void from_json(const Json& json, cnerf::Aabbd& box) {
    json.at("min").get_to(box.min);
    json.at("max").get_to(box.max);
  }
};

}  // namespace nlohmann
