#pragma once
/// Launchers: who started this process beside others, and where they meet.

#include <functional>
#include <optional>
#include <string>

namespace cnerf::cluster {

/// The place of a process among those that were started together.
struct Launch {
  std::string launcher;                ///< "torchrun", "Open MPI", "Slurm"
  int rank = 0, size = 1;              ///< of all processes
  int local_rank = 0, local_size = 1;  ///< of those on this machine
  std::string host;                    ///< where the processes meet: a name or an address of the first one's machine
  int port = 0;
  bool has_store = false;     ///< the launcher keeps the store itself, and every process is a client of it
  bool has_own_gpus = false;  ///< the launcher gave each process GPUs that no other has
  std::string attempt;        ///< tells a restarted job from the one before, whose words the store may still hold
};

/// The value of a variable of the environment; nothing where it is not set or empty.
using GetVariable = std::function<std::optional<std::string>(const std::string& name)>;
[[nodiscard]] GetVariable environment();

/// What torchrun, Open MPI's mpirun or Slurm's srun say of this process; nothing where none of them started it, or it
/// is the only one. MASTER_ADDR and MASTER_PORT overrule where the processes meet.
/// @throws UsageError  variables that contradict each other, or no word of where to meet
[[nodiscard]] std::optional<Launch> find_launch(const GetVariable& variable);

/// The GPU of a process.
struct GpuChoice {
  std::string gpu = {};    ///< as CUDA_VISIBLE_DEVICES names it; empty: the machine has none
  bool is_shared = false;  ///< with others of the launch
};
/// Processes of a machine take its GPUs in turns.
/// @param visible     what CUDA_VISIBLE_DEVICES says: "2,5"; of one GPU, that the launcher has shared them out
/// @param of_machine  how many there are, where that says nothing
[[nodiscard]] GpuChoice choose_gpu(const Launch& launch, const std::optional<std::string>& visible, int of_machine);

/// The first name of a Slurm list: "n[03-05,9],m1" gives "n03".
[[nodiscard]] std::string first_host(const std::string& nodes);

}  // namespace cnerf::cluster
