#pragma once
/// Small files of every kind the program reads, made by the program itself where it writes them, and the commands that
/// read them.

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "tests/mutants/envelope.h"
#include "tests/mutants/limited_run.h"

namespace cnerf::mutants {

/// One call of the program. `{}` in an argument is the folder that holds the mutant.
struct Step {
  std::vector<std::string> arguments;
  std::string interrupt_at;  ///< what it prints before Ctrl-C ends it; empty = it ends by itself
};

/// A kind of file, and what reads it.
struct Kind {
  std::string name;
  std::filesystem::path stage;  ///< folder that is copied for each mutant
  std::filesystem::path file;   ///< in it: the one that is changed
  bool is_text = false;
  Format format = Format::kPlain;
  std::vector<Step> steps;  ///< until one refuses
  /// Makes checksums in other files of the stage fit the changed one; asked in half of the mutants.
  std::function<void(const std::filesystem::path& stage)> amend = {};
};

/// Where the program is, and a folder for originals.
struct Workshop {
  std::filesystem::path program, folder;
  Limits limits;
};

/// @throws Error  when the program does not make one of them.
[[nodiscard]] std::vector<Kind> make_originals(const Workshop& workshop);

/// A bake of the sample scene as a bundle for browsers, and the options of training it takes a minute with.
/// @return  the folder of the bundle
[[nodiscard]] std::filesystem::path make_bundle(const Workshop& workshop);

/// A capture of four views of 24 x 16 pixels.
[[nodiscard]] std::filesystem::path make_capture(const Workshop& workshop);

/// Options under which training and everything after it take a fraction of a second.
[[nodiscard]] std::vector<std::string> least_options();

}  // namespace cnerf::mutants
