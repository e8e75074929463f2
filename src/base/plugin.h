#pragma once
/// Parts of the program that are loaded when they are needed: shared libraries of ours, libcnerf_NAME.so, for what
/// takes long to load and few commands use.
///
/// A plug-in holds copies of the lower rooms that it needs. The program exports its own (cmake/exported_symbols.txt),
/// and the loader prefers those: the number of threads, Ctrl-C and the types of errors are the same on both sides.

#include <string>

namespace cnerf {

/// The address of a symbol of libcnerf_`plugin`.so, which stays loaded. The library is looked for beside the program,
/// in
/// ../lib/cnerf and in the build tree.
/// @throws DeviceError  no such file, it cannot be loaded, or it lacks the symbol; says where it was looked for.
[[nodiscard]] void* plugin_symbol(const std::string& plugin, const std::string& symbol);

/// What a plug-in offers: a table of functions, the result of its `extern "C"` function `entry`.
template <typename Table>
const Table& plugin_table(const std::string& plugin, const std::string& entry) {
  return *reinterpret_cast<const Table* (*)()>(plugin_symbol(plugin, entry))();
}

}  // namespace cnerf
