#pragma once
/// Plug-ins: our own shared libraries, libcnerf_NAME.so, for parts that take long to load and few commands use. They
/// are loaded on first use.
///
/// A plug-in links copies of the lower rooms that it needs. The program exports the symbols of its own copies
/// (cmake/exported_symbols.txt), and the loader prefers those. A library that is itself loaded by somebody else, as the
/// Python module is, keeps its symbols to itself; a plug-in then uses its own copies. Little is shared between the two:
/// the number of threads lies in TBB, types of errors are compared by name, and the state of Ctrl-C is handed over
/// when a plug-in is loaded.

#include <filesystem>
#include <string>
#include <vector>

namespace cnerf {

/// A file of the program's: looked for beside the file that holds this code (the program, or the Python module), in
/// lib/cnerf of the installation that it is part of, and where this build keeps or installs it.
/// @throws DeviceError  saying where it was looked for.
[[nodiscard]] std::filesystem::path program_part(const std::string& name);

/// Where a file or folder of the program's data may lie, the first place first: share/cnerf of the installation, and
/// where this build keeps or installs it.
[[nodiscard]] std::vector<std::filesystem::path> data_places(const std::string& name);

/// What `call` returns, given the `extern "C"` function `entry` of libcnerf_`plugin`.so; the library stays loaded.
/// @throws DeviceError     no such file, it cannot be loaded, or it lacks the function
/// @throws std::bad_alloc  memory did not suffice to load it. Where it aborts for that reason as it begins, the program
///                         ends with ExitCode::kMemory.
[[nodiscard]] const void* begun_plugin(const std::string& plugin, const std::string& entry,
                                       const void* (*call)(void* entry));

/// The table of functions that a plug-in offers: the result of its `extern "C"` function `entry`.
template <typename Table>
const Table& plugin_table(const std::string& plugin, const std::string& entry) {
  const auto call = [](void* function) -> const void* { return reinterpret_cast<const Table* (*)()>(function)(); };
  return *static_cast<const Table*>(begun_plugin(plugin, entry, call));
}

}  // namespace cnerf
