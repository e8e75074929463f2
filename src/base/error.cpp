#include "src/base/error.h"

#include <system_error>

namespace cnerf {

InputError::InputError(const std::filesystem::path& file, const std::string& field, const std::string& problem)
    : InputError(file.string() + ": " + (field.empty() ? "" : field + ": ") + problem) {}

ExitCode exit_code_of(const std::filesystem::filesystem_error& error) {
  const auto is = [&](std::errc kind) { return error.code() == kind; };
  if (is(std::errc::no_such_file_or_directory)) return ExitCode::kMissingInput;
  const bool is_of_input = is(std::errc::permission_denied) || is(std::errc::filename_too_long) ||
                           is(std::errc::too_many_symbolic_link_levels);
  return is_of_input ? ExitCode::kInput : ExitCode::kOutput;
}

}  // namespace cnerf
