#pragma once
/// How a record names its fields for those that write and read it (src/base/json_record.h): one static member template
///
///     template <typename Self, typename Visitor>
///     static void visit(Self& self, Visitor&& v) {
///       v("pixels", self.pixels);           // required
///       v("error", self.error, kOptional);  // left out where it equals its default
///     }

namespace cnerf {

/// Marks a field that may be absent; it then keeps its default.
struct OptionalField {};
inline constexpr OptionalField kOptional;

}  // namespace cnerf
