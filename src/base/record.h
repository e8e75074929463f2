#pragma once
/// How a record lists its fields for serialisation (src/base/json_record.h): one static member template
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
/// Marks a derived field that is written for other programs and not read.
struct WrittenField {};
inline constexpr WrittenField kWritten;

}  // namespace cnerf
