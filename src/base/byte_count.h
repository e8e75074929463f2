#pragma once
/// Amounts of memory, parsed from and formatted for people.

#include <cstddef>
#include <string>

namespace cnerf {

/// "4G", "500M", "64k" (powers of 1024) or a number of bytes.
/// @param option  that `text` is the value of, for the message  @throws UsageError  not a positive amount.
[[nodiscard]] std::size_t bytes_from(const std::string& option, const std::string& text);

/// "1.25 GiB", "37 MiB".
[[nodiscard]] std::string in_words(std::size_t bytes);

}  // namespace cnerf
