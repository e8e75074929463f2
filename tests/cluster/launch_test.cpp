/// Launchers, by the variables that they set.

#include <gtest/gtest.h>

#include <map>

#include "src/base/error.h"
#include "src/cluster/launch.h"

namespace cnerf::cluster {
namespace {

std::optional<Launch> launch_of(std::map<std::string, std::string> variables) {
  return find_launch([variables = std::move(variables)](const std::string& name) -> std::optional<std::string> {
    const auto found = variables.find(name);
    if (found == variables.end() || found->second.empty()) return std::nullopt;
    return found->second;
  });
}

const std::map<std::string, std::string> kTorchrun = {{"RANK", "1"},        {"WORLD_SIZE", "4"},
                                                      {"LOCAL_RANK", "1"},  {"LOCAL_WORLD_SIZE", "2"},
                                                      {"MASTER_ADDR", "a"}, {"MASTER_PORT", "29500"}};

std::map<std::string, std::string> with(std::map<std::string, std::string> variables, const std::string& name,
                                        const std::string& value) {
  variables[name] = value;
  return variables;
}

TEST(Launch, NothingStartedThisAlone) {
  EXPECT_FALSE(launch_of({}));
  EXPECT_FALSE(launch_of(with(kTorchrun, "WORLD_SIZE", "1")));
}

TEST(Launch, TorchrunSaysWhoIsWho) {
  const auto launch = launch_of(kTorchrun);
  ASSERT_TRUE(launch);
  EXPECT_EQ(launch->launcher, "torchrun");
  EXPECT_EQ(launch->rank, 1);
  EXPECT_EQ(launch->size, 4);
  EXPECT_EQ(launch->local_rank, 1);
  EXPECT_EQ(launch->local_size, 2);
  EXPECT_EQ(launch->host, "a");
  EXPECT_EQ(launch->port, 29500);
  EXPECT_FALSE(launch->has_store);
}

/// Rank 0 would wait for ever on a port that is taken, if it opened a store of its own.
TEST(Launch, TorchrunsAgentMayKeepTheStore) {
  EXPECT_TRUE(launch_of(with(kTorchrun, "TORCHELASTIC_USE_AGENT_STORE", "True"))->has_store);
  EXPECT_FALSE(launch_of(with(kTorchrun, "TORCHELASTIC_USE_AGENT_STORE", "False"))->has_store);
}

/// Its store still holds what the processes said that died.
TEST(Launch, ARestartIsAnotherAttempt) {
  const auto first = launch_of(with(kTorchrun, "TORCHELASTIC_RESTART_COUNT", "0"));
  const auto second = launch_of(with(kTorchrun, "TORCHELASTIC_RESTART_COUNT", "1"));
  EXPECT_NE(first->attempt, second->attempt);
}

const std::map<std::string, std::string> kSlurm = {{"SLURM_PROCID", "3"},
                                                   {"SLURM_STEP_NUM_TASKS", "8"},
                                                   {"SLURM_LOCALID", "1"},
                                                   {"SLURM_STEP_TASKS_PER_NODE", "2(x4)"},
                                                   {"SLURM_STEP_NODELIST", "n[07-10]"},
                                                   {"SLURM_JOB_ID", "17"},
                                                   {"SLURM_STEP_ID", "0"}};

TEST(Launch, SlurmSaysWhoIsWho) {
  const auto launch = launch_of(kSlurm);
  ASSERT_TRUE(launch);
  EXPECT_EQ(launch->rank, 3);
  EXPECT_EQ(launch->size, 8);
  EXPECT_EQ(launch->local_rank, 1);
  EXPECT_EQ(launch->local_size, 2);
  EXPECT_EQ(launch->host, "n07");
  EXPECT_GE(launch->port, 1024);
  EXPECT_EQ(launch_of(with(kSlurm, "SLURM_PROCID", "5"))->port, launch->port);
  EXPECT_NE(launch_of(with(kSlurm, "SLURM_STEP_ID", "1"))->port, launch->port);
}

TEST(Launch, SlurmsNodesMayHaveDifferentNumbersOfTasks) {
  const auto tasks_of = [](const std::string& list, const std::string& node) {
    const auto first_of_node = with(with(kSlurm, "SLURM_LOCALID", "0"), "SLURM_NODEID", node);
    return launch_of(with(first_of_node, "SLURM_STEP_TASKS_PER_NODE", list))->local_size;
  };
  EXPECT_EQ(tasks_of("4,2(x2)", "0"), 4);
  EXPECT_EQ(tasks_of("4,2(x2)", "1"), 2);
  EXPECT_EQ(tasks_of("4,2(x2)", "2"), 2);
  EXPECT_EQ(tasks_of("2(x3),1,3", "3"), 1);
  EXPECT_EQ(tasks_of("2(x3),1,3", "4"), 3);
  EXPECT_EQ(tasks_of("2(x3),1", "4"), 2) << "the first node's, where the list does not say";
  EXPECT_EQ(tasks_of("2(x3),1", ""), 2);
  EXPECT_THROW((void)tasks_of("2(xthree)", "0"), UsageError);
}

/// sbatch gives its script the variables of the job: a program that the script calls without srun is alone.
TEST(Launch, AScriptOfSbatchIsNoRank) {
  EXPECT_FALSE(launch_of({{"SLURM_PROCID", "0"}, {"SLURM_NTASKS", "4"}, {"SLURM_NODELIST", "n[1-4]"}}));
}

TEST(Launch, OpenMpiSaysWhoIsWho) {
  const std::map<std::string, std::string> variables = {{"OMPI_COMM_WORLD_RANK", "1"},
                                                        {"OMPI_COMM_WORLD_SIZE", "2"},
                                                        {"OMPI_COMM_WORLD_LOCAL_RANK", "1"},
                                                        {"OMPI_COMM_WORLD_LOCAL_SIZE", "2"}};
  const auto launch = launch_of(variables);
  ASSERT_TRUE(launch);
  EXPECT_EQ(launch->host, "127.0.0.1");
  // Of several machines mpirun does not say where the first process is.
  EXPECT_THROW(launch_of(with(variables, "OMPI_COMM_WORLD_LOCAL_SIZE", "1")), UsageError);
  EXPECT_EQ(launch_of(with(with(variables, "OMPI_COMM_WORLD_LOCAL_SIZE", "1"), "MASTER_ADDR", "b"))->host, "b");
}

TEST(Launch, NonsenseIsRefused) {
  EXPECT_THROW(launch_of(with(kTorchrun, "RANK", "4")), UsageError);
  EXPECT_THROW(launch_of(with(kTorchrun, "RANK", "first")), UsageError);
  EXPECT_THROW(launch_of(with(kTorchrun, "MASTER_ADDR", "")), UsageError);
  EXPECT_THROW(launch_of(with(kTorchrun, "MASTER_PORT", "")), UsageError);
  EXPECT_THROW(launch_of(with(kTorchrun, "MASTER_PORT", "65536")), UsageError);
  EXPECT_THROW(launch_of(with(kTorchrun, "LOCAL_WORLD_SIZE", "0")), UsageError) << "threads are divided by it";
  EXPECT_THROW(launch_of(with(kSlurm, "SLURM_LOCALID", "2147483647")), UsageError);
}

TEST(Launch, ProcessesOfAMachineTakeItsGpusInTurns) {
  const auto gpu_of = [](int local_rank, int local_size, const std::optional<std::string>& visible, int of_machine) {
    Launch launch;
    launch.local_rank = local_rank;
    launch.local_size = local_size;
    const GpuChoice choice = choose_gpu(launch, visible, of_machine);
    return choice.gpu + (choice.is_shared ? " shared" : "");
  };
  EXPECT_EQ(gpu_of(1, 2, std::nullopt, 8), "1");
  EXPECT_EQ(gpu_of(2, 3, std::nullopt, 2), "0 shared") << "and not one that is not there";
  EXPECT_EQ(gpu_of(1, 2, std::nullopt, 0), " shared") << "the variable stays as it is";
  EXPECT_EQ(gpu_of(1, 2, "2,5", 8), "5");
  EXPECT_EQ(gpu_of(2, 4, "2,5", 8), "2 shared");
  EXPECT_EQ(gpu_of(1, 2, "5", 8), "5") << "the launcher gave the other one another";
  Launch own;
  own.local_rank = 2, own.local_size = 4, own.has_own_gpus = true;
  EXPECT_FALSE(choose_gpu(own, "0,1", 8).is_shared) << "by --gpus-per-task";
}

TEST(Launch, FirstHostOfAList) {
  EXPECT_EQ(first_host("n[03-05,9],m1"), "n03");
  EXPECT_EQ(first_host("n[7]"), "n7");
  EXPECT_EQ(first_host("fermi,n[1-2]"), "fermi");
  EXPECT_EQ(first_host("fermi"), "fermi");
}

}  // namespace
}  // namespace cnerf::cluster
