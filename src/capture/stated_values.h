#pragma once
/// Values as the poses files of other programs state them, checked on the way in.

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "src/base/vec3.h"

namespace cnerf {

/// The numbers of a text, separated by blanks.
/// @param file, field  for messages
/// @throws InputError  unless there are `count` of them and nothing else, all finite
[[nodiscard]] std::vector<double> numbers_of(std::string_view text, std::size_t count,
                                             const std::filesystem::path& file, const std::string& field);
[[nodiscard]] double number_of(std::string_view text, const std::filesystem::path& file, const std::string& field);

/// The side of an image in pixels.  @throws InputError  unless it is a whole number from 1 to 100000.
[[nodiscard]] int side_of_image(double value, const std::filesystem::path& file, const std::string& field);

/// The value.  @throws InputError  unless it is above 0.
double above_zero(double value, const std::filesystem::path& file, const std::string& field);

/// Nine numbers, row by row.
[[nodiscard]] Mat3d matrix_of(const std::vector<double>& rows);

}  // namespace cnerf
