#include "src/base/error.h"

namespace cnerf {

InputError::InputError(const std::filesystem::path& file, const std::string& field, const std::string& problem)
    : InputError(file.string() + ": " + (field.empty() ? "" : field + ": ") + problem) {}

}  // namespace cnerf
