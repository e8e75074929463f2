#include "src/base/progress.h"

#include <csignal>
#include <cstdlib>

namespace cnerf {
namespace {

volatile std::sig_atomic_t interruption = 0;

void handle_signal(int) {
  if (interruption != 0) std::_Exit(130);
  interruption = 1;
}

}  // namespace

bool interruption_requested() {
  return interruption != 0;
}

void install_interruption_handler() {
  std::signal(SIGINT, handle_signal);
  std::signal(SIGTERM, handle_signal);
}

}  // namespace cnerf
