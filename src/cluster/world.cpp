#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <string_view>
#include <system_error>

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

/// By their devices: CUDA, once it is asked, keeps to the GPUs that it saw.
int gpus_of_machine() {
  constexpr std::string_view kDevice = "nvidia";
  int count = 0;
  std::error_code failure;
  for (const auto& entry : std::filesystem::directory_iterator("/dev", failure)) {
    const std::string name = entry.path().filename().string();
    const std::string which = name.starts_with(kDevice) ? name.substr(kDevice.size()) : "";
    if (!which.empty() && which.find_first_not_of("0123456789") == std::string::npos) ++count;
  }
  return count;
}

/// Each local rank sees one GPU alone. Without effect where the launcher has shared them out, one each.
/// @return  whether others see the same one
bool take_gpu(const Launch& launch) {
  constexpr const char* kVariable = "CUDA_VISIBLE_DEVICES";
  const auto visible = environment()(kVariable);
  if (!visible && std::getenv(kVariable) != nullptr) return false;  // empty: none
  const GpuChoice choice = choose_gpu(launch, visible, gpus_of_machine());
  if (!choice.gpu.empty()) ::setenv(kVariable, choice.gpu.c_str(), 1);
  return choice.is_shared;
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
  const bool shares_gpu = take_gpu(*launch);
  static Channel channel = plugin_table<Channel>("cluster", "cnerf_cluster_channel");
  if (shares_gpu) channel.device_sums = nullptr;  // NCCL wants a GPU for each
  joined = new JoinedRanks({*launch, channel, Patience(), kTimeToCome, process_name(), end_program});
}

bool leave_world(const std::optional<std::string>& error) {
  if (joined == nullptr) return false;
  joined->leave(error);
  return true;
}

}  // namespace cnerf::cluster
