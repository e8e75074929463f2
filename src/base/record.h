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
/// Marks a field that files of earlier versions lack; it is always written.
struct LaterField {};
inline constexpr LaterField kLater;
/// Marks a std::optional that is written as null where it is empty.
struct NullableField {};
inline constexpr NullableField kNullable;
/// Marks what is written for other programs and follows from the rest: it is not read.
struct WrittenField {};
inline constexpr WrittenField kWritten;

}  // namespace cnerf
