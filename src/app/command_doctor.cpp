/// cnerf doctor: what this machine and build can do, and what is missing.

#include <fmt/format.h>

#include "src/app/command.h"
#include "src/pipeline/facts.h"

namespace cnerf::app {

Work declare_doctor(CLI::App&) {
  return [](const auto&) {
    for (const auto& [name, value] : pipeline::facts_of_machine()) fmt::print("{:<16} {}\n", name + ":", value);
  };
}

}  // namespace cnerf::app
