#pragma once
/// Fuzz targets: functions that hand any bytes to one of the program's readers. A reader may take them, or refuse them
/// by an Error whose message names the file. Another exception, a crash, a sanitizer's report, much memory or a hang is
/// a finding.
///
/// A target is run by libFuzzer (fuzz_main.cpp, in builds of -DCNERF_FUZZ=ON) and, on the inputs of corpus/ and on some
/// mutations of them, by the test fuzz_test (fuzz_test.cpp) in all others.

#include <cstddef>
#include <cstring>
#include <filesystem>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "src/base/error.h"

namespace cnerf::fuzz {

using Bytes = std::span<const std::byte>;

struct Target {
  const char* name;
  void (*run)(Bytes input);
};

/// Those of this executable.
[[nodiscard]] std::vector<Target>& targets();

struct Registration {
  Registration(const char* name, void (*run)(Bytes)) { targets().push_back({name, run}); }
};

/// A promise that a reader did not keep.
struct Finding : std::logic_error {
  using std::logic_error::logic_error;
};

/// A folder of this process in memory, or where $TMPDIR says; gone at its end.
[[nodiscard]] const std::filesystem::path& scratch_folder();
/// The file `name` of that folder, which holds `content` from now on.
[[nodiscard]] std::filesystem::path scratch_file(const std::string& name, Bytes content);

[[nodiscard]] inline Bytes bytes_of(std::string_view text) {
  return std::as_bytes(std::span(text));
}
[[nodiscard]] inline std::string text_of(Bytes bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// What an input says of itself in its first byte: 0 where it is empty.
[[nodiscard]] inline unsigned take_byte(Bytes& input) {
  if (input.empty()) return 0;
  const auto first = std::to_integer<unsigned>(input.front());
  input = input.subspan(1);
  return first;
}

/// The input in `count` pieces, at the mark "\n--\n"; those that are missing are empty.
[[nodiscard]] std::vector<Bytes> pieces_of(Bytes input, std::size_t count);

template <typename T>
void append_value(std::vector<std::byte>& to, const T& value) {
  const auto bytes = std::as_bytes(std::span(&value, 1));
  to.insert(to.end(), bytes.begin(), bytes.end());
}
inline void append_bytes(std::vector<std::byte>& to, Bytes bytes) {
  to.insert(to.end(), bytes.begin(), bytes.end());
}

/// @throws Finding  where the refusal does not say which file, or what is wrong with it.
inline void check_refusal(const Error& refusal, const std::filesystem::path& file) {
  const std::string_view message = refusal.what();
  if (message.find(file.string()) == message.npos) {
    throw Finding("a refusal does not name the file " + file.string() + ": " + std::string(message));
  }
  if (message.size() > 4096) throw Finding("a refusal is longer than a page: " + std::string(message.substr(0, 4096)));
}

/// Calls a reader, which may refuse `file`.
template <typename Read>
void read_or_refuse(const std::filesystem::path& file, Read&& read) {
  try {
    (void)read();
  } catch (const Error& refusal) {
    check_refusal(refusal, file);
  }
}

}  // namespace cnerf::fuzz

/// Defines and registers a target: CNERF_FUZZ_TARGET(transforms) { … input … }
#define CNERF_FUZZ_TARGET(name)                                                     \
  static void fuzz_##name(::cnerf::fuzz::Bytes input);                              \
  static const ::cnerf::fuzz::Registration registration_##name(#name, fuzz_##name); \
  static void fuzz_##name([[maybe_unused]] ::cnerf::fuzz::Bytes input)
