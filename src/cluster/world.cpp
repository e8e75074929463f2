#include <unistd.h>

#include <cstdlib>
#include <iostream>
#include <sstream>

#include "src/base/error.h"
#include "src/base/plugin.h"
#include "src/cluster/ranks.h"

namespace cnerf::cluster {
namespace {

constexpr Seconds kTimeToCome{60};

/// Never destroyed: threads of libraries may wait in the network when the program ends.
JoinedRanks* joined = nullptr;

std::string process_name() {
  char host[256] = "";
  ::gethostname(host, sizeof host - 1);
  return "pid " + std::to_string(::getpid()) + " on " + host;
}

/// Each local rank sees one GPU alone. Without effect where the launcher has shared them out, one each.
void choose_gpu(int local_rank) {
  const auto visible = environment()("CUDA_VISIBLE_DEVICES");
  if (!visible && std::getenv("CUDA_VISIBLE_DEVICES") != nullptr) return;  // empty: none
  std::vector<std::string> gpus;
  std::istringstream list(visible.value_or(""));
  for (std::string gpu; std::getline(list, gpu, ',');) gpus.push_back(gpu);
  const std::string own = gpus.empty() ? std::to_string(local_rank) : gpus[std::size_t(local_rank) % gpus.size()];
  ::setenv("CUDA_VISIBLE_DEVICES", own.c_str(), 1);
}

/// Files are whole or not there, so that this can come at any time.
void end_program(const std::string& why) {
  const std::string line = "\ncnerf: error: " + why + "\n";
  (void)!::write(STDERR_FILENO, line.data(), line.size());
  std::_Exit(int(ExitCode::kRanks));
}

}  // namespace

Ranks& world() {
  return joined != nullptr ? static_cast<Ranks&>(*joined) : alone();
}

void join_world() {
  const std::optional<Launch> launch = find_launch(environment());
  if (!launch) return;
  choose_gpu(launch->local_rank);
  const auto& channel = plugin_table<Channel>("cluster", "cnerf_cluster_channel");
  joined = new JoinedRanks({*launch, channel, Patience(), kTimeToCome, process_name(), end_program});
}

bool leave_world(const std::optional<std::string>& error) {
  if (joined == nullptr) return false;
  joined->leave(error);
  return true;
}

}  // namespace cnerf::cluster
