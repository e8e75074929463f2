#include "src/cluster/launch.h"

#include <algorithm>
#include <cstdlib>
#include <vector>

#include "src/base/error.h"
#include "src/base/text.h"

namespace cnerf::cluster {
namespace {

constexpr int kFirstPort = 20000, kPorts = 10000;  // below those that systems give away themselves
constexpr int kLastPort = 65535, kMostProcesses = 1 << 20;

int parsed(const std::string& name, const std::string& text) {
  const std::optional<int> value = value_in<int>(text);
  if (value && *value >= 0 && *value <= kMostProcesses) return *value;
  throw UsageError("$" + name + ": expected a whole number up to 2^20, found '" + text + "'");
}

int number(const GetVariable& variable, const std::string& name, int fallback) {
  const auto text = variable(name);
  return text ? parsed(name, *text) : fallback;
}

/// Of the processes of one job; two jobs on one machine are unlikely to have the same.
int port_of(const GetVariable& variable, const std::string& job) {
  unsigned hash = 2166136261u;  // FNV-1a
  for (const char c : job) hash = (hash ^ static_cast<unsigned char>(c)) * 16777619u;
  return number(variable, "MASTER_PORT", kFirstPort + int(hash % unsigned(kPorts)));
}

/// Where the variables of a launcher say who a process is.
struct RankVariables {
  const char *rank, *size, *local_rank;
};

Launch numbered(const GetVariable& variable, const char* launcher, const RankVariables& names) {
  Launch launch;
  launch.launcher = launcher;
  launch.rank = number(variable, names.rank, 0);
  launch.size = number(variable, names.size, 1);
  launch.local_rank = number(variable, names.local_rank, 0);
  return launch;
}

std::optional<Launch> by_torchrun(const GetVariable& variable) {
  if (!variable("RANK") || !variable("WORLD_SIZE")) return std::nullopt;
  Launch launch = numbered(variable, "torchrun", {"RANK", "WORLD_SIZE", "LOCAL_RANK"});
  launch.local_size = number(variable, "LOCAL_WORLD_SIZE", 1);
  launch.host = variable("MASTER_ADDR").value_or("");
  launch.port = number(variable, "MASTER_PORT", 0);
  launch.has_store = variable("TORCHELASTIC_USE_AGENT_STORE").value_or("") == "True";
  launch.attempt =
      variable("TORCHELASTIC_RUN_ID").value_or("") + "-" + variable("TORCHELASTIC_RESTART_COUNT").value_or("0");
  if (launch.port == 0) throw UsageError("$MASTER_PORT: expected a port, as $RANK and $WORLD_SIZE are set");
  return launch;
}

std::optional<Launch> by_open_mpi(const GetVariable& variable) {
  if (!variable("OMPI_COMM_WORLD_RANK")) return std::nullopt;
  Launch launch =
      numbered(variable, "Open MPI", {"OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_LOCAL_RANK"});
  launch.local_size = number(variable, "OMPI_COMM_WORLD_LOCAL_SIZE", 1);
  const bool is_one_machine = launch.local_size == launch.size;
  launch.host = variable("MASTER_ADDR").value_or(is_one_machine ? "127.0.0.1" : "");
  launch.port = port_of(variable, variable("PMIX_NAMESPACE").value_or("mpi"));
  return launch;
}

/// Of "2(x3),1": the tasks of this node, or of the first one where that is unknown.
int tasks_of_node(const GetVariable& variable) {
  const std::string name = "SLURM_STEP_TASKS_PER_NODE";
  const std::vector<std::string> parts = split(variable(name).value_or("1"), ',');
  int nodes_before = number(variable, "SLURM_NODEID", 0);
  std::optional<int> of_first;
  for (const std::string& part : parts) {
    const std::size_t times = part.find("(x"), end = part.find(')');
    const int tasks = parsed(name, part.substr(0, times));
    const int nodes = times == std::string::npos ? 1 : parsed(name, part.substr(times + 2, end - times - 2));
    if (nodes_before < nodes) return tasks;
    nodes_before -= nodes;
    if (!of_first) of_first = tasks;
  }
  return of_first.value_or(1);
}

/// A script of sbatch has the variables of its job; only what srun started has those of a step.
std::optional<Launch> by_slurm(const GetVariable& variable) {
  if (!variable("SLURM_PROCID") || !variable("SLURM_STEP_NUM_TASKS")) return std::nullopt;
  Launch launch = numbered(variable, "Slurm", {"SLURM_PROCID", "SLURM_STEP_NUM_TASKS", "SLURM_LOCALID"});
  launch.local_size = std::max(tasks_of_node(variable), launch.local_rank + 1);
  launch.has_own_gpus = variable("SLURM_GPUS_PER_TASK") || variable("SLURM_TRES_PER_TASK");
  launch.host =
      variable("MASTER_ADDR")
          .value_or(first_host(variable("SLURM_STEP_NODELIST").value_or(variable("SLURM_NODELIST").value_or(""))));
  const std::string job = variable("SLURM_JOB_ID").value_or("0") + "." + variable("SLURM_STEP_ID").value_or("0");
  launch.port = port_of(variable, job);
  launch.attempt = job + "-" + variable("SLURM_RESTART_COUNT").value_or("0");
  return launch;
}

}  // namespace

GetVariable environment() {
  return [](const std::string& name) -> std::optional<std::string> {
    const char* value = std::getenv(name.c_str());
    if (value == nullptr || *value == '\0') return std::nullopt;
    return value;
  };
}

GpuChoice choose_gpu(const Launch& launch, const std::optional<std::string>& visible, int of_machine) {
  std::vector<std::string> gpus = split(visible.value_or(""), ',');
  const bool is_shared_out = gpus.size() == 1 || launch.has_own_gpus;
  for (int gpu = 0; !visible && gpu < of_machine; ++gpu) gpus.push_back(std::to_string(gpu));
  if (gpus.empty()) return {"", launch.local_size > 1};  // WSL has a GPU, and no device file
  return {gpus[std::size_t(launch.local_rank) % gpus.size()],
          !is_shared_out && gpus.size() < std::size_t(launch.local_size)};
}

std::string first_host(const std::string& nodes) {
  const std::size_t bracket = nodes.find('['), comma = nodes.find(',');
  if (bracket == std::string::npos || comma < bracket) return nodes.substr(0, comma);
  const std::size_t end = nodes.find_first_of("-,]", bracket);
  return nodes.substr(0, bracket) + nodes.substr(bracket + 1, end == std::string::npos ? end : end - bracket - 1);
}

std::optional<Launch> find_launch(const GetVariable& variable) {
  std::optional<Launch> launch = by_torchrun(variable);
  if (!launch) launch = by_open_mpi(variable);
  if (!launch) launch = by_slurm(variable);
  if (!launch || launch->size == 1) return std::nullopt;
  if (launch->size < 1 || launch->local_size < 1 || launch->rank >= launch->size) {
    throw UsageError(launch->launcher + ": rank " + std::to_string(launch->rank) + " of " +
                     std::to_string(launch->size) + " processes, " + std::to_string(launch->local_size) +
                     " on its machine, is none");
  }
  if (launch->port < 1 || launch->port > kLastPort) {
    throw UsageError("$MASTER_PORT: expected 1 to 65535, found " + std::to_string(launch->port));
  }
  if (launch->host.empty()) {
    throw UsageError(launch->launcher +
                     ": $MASTER_ADDR has to name the machine of the first process, where the others find it");
  }
  return launch;
}

}  // namespace cnerf::cluster
