#pragma once
/// NumPy's .npy files, as far as captures need them.

#include <cstddef>
#include <filesystem>
#include <vector>

namespace cnerf {

struct NpyArray {
  std::vector<std::size_t> shape;
  std::vector<double> values;  ///< in C order, whatever order the file has
};

/// Reads versions 1 to 3 of the format with little-endian floats or integers of 4 or 8 bytes, in C or Fortran order.
/// @throws MissingInputError, InputError  not an .npy file, another dtype (named), or fewer values than the shape
/// needs.
[[nodiscard]] NpyArray read_npy(const std::filesystem::path& file);

}  // namespace cnerf
