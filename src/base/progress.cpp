#include "src/base/progress.h"

#include <atomic>
#include <csignal>
#include <cstdlib>

namespace cnerf {
namespace {

std::atomic<int> own_interruption = 0;
static_assert(std::atomic<int>::is_always_lock_free, "a signal handler may wait for nothing");
std::atomic<int>* interruption = &own_interruption;  // in a plug-in's copy: that of who loaded it

void handle_signal(int) {
  if (*interruption != 0) std::_Exit(130);
  *interruption = 1;
}

/// A terminal that goes away says so twice, so that a second time is no impatience.
void handle_hangup(int) {
  *interruption = 1;
}

}  // namespace

bool interruption_requested() {
  return *interruption != 0;
}

void install_interruption_handler() {
  std::signal(SIGINT, handle_signal);
  std::signal(SIGTERM, handle_signal);
  // A terminal that goes away, unless `nohup` had it ignored.
  if (std::signal(SIGHUP, handle_hangup) == SIG_IGN) std::signal(SIGHUP, SIG_IGN);
  std::signal(SIGCHLD, SIG_DFL);  // ignored, which is inherited, how a child ends would be lost
}

void request_interruption() {
  *interruption = 1;
}
void forget_interruption() {
  *interruption = 0;
}
std::atomic<int>* interruption_flag() {
  return interruption;
}

}  // namespace cnerf

/// Called by name in a plug-in that was loaded, so that its copy of this file sees the same Ctrl-C.
extern "C" void cnerf_follow_interruption(std::atomic<int>* flag) {
  cnerf::interruption = flag;
}
