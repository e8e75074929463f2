#pragma once
/// Other programs of the system: where they are, and running one to its end. POSIX only.

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace cnerf {

/// The executable that `name` stands for: on $PATH, or itself where it holds a slash; nothing when there is none.
[[nodiscard]] std::optional<std::filesystem::path> find_program(const std::string& name);

/// Runs `words` (the program and its arguments; no shell) with both of its outputs appended to `log` and no input.
/// `watch` is called a few times a second meanwhile; when it throws, the program and all it started are killed and the
/// exception goes on.
/// @return  its exit status; 128 + n when signal n killed it.
/// @throws OutputError  when the log cannot be written.  @throws DeviceError  when the program cannot be started.
int run_program(const std::vector<std::string>& words, const std::filesystem::path& log,
                const std::function<void()>& watch = {});

}  // namespace cnerf
