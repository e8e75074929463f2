#pragma once
/// The commands that campaigns disturb, each on captures and runs so small that it takes a second.

#include <filesystem>
#include <string>
#include <vector>

#include "tests/faults/program_under_faults.h"

namespace cnerf::faults {

/// A command, and what has to lie in the root before it.
struct Command {
  std::string name;
  std::string fixture;             ///< copied to @/run before; "" = nothing
  std::vector<std::string> words;  ///< "@" = the root
  std::vector<std::string> info;   ///< what `cnerf info` is asked about afterwards; below the root
};

/// What commands begin with, made once in SCRATCH/fixtures: a capture, photographs and a model of it, a run, a take
/// "t", its bake, and the same with a page.
class Fixtures {
 public:
  /// @throws std::runtime_error  when the program cannot make them.
  Fixtures(const Subject& subject, const std::filesystem::path& scratch);
  /// All commands by name: sample prepare train colorize bake web gltf exr eval render run compare.
  [[nodiscard]] std::vector<Command> commands() const;
  /// Those named; all when none is.  @throws std::runtime_error  on an unknown name.
  [[nodiscard]] std::vector<Command> commands(const std::vector<std::string>& names) const;
  /// What pairs are made of; all of them work on a run at @/run with a take "t" and its page.
  [[nodiscard]] std::vector<Command> neighbours() const;
  /// Files that `cnerf info` reads, one of each kind.
  [[nodiscard]] std::vector<Command> readers() const;
  /// Puts a command's fixture into the slot, which is cleared.
  void lay_out(const Slot& slot, const Command& command) const;

 private:
  std::filesystem::path folder_;
};

}  // namespace cnerf::faults
