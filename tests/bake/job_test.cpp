#include "bake/job/job.h"

#include <gtest/gtest.h>

#include "src/base/error.h"
#include "tests/bake/analytic_field.h"
#include "tests/bake/processor_alone.h"
#include "tests/support/data.h"

namespace cnerf::bake::test {
namespace {
namespace fs = std::filesystem;

class Listener final : public Observer {
 public:
  void say(const std::string& text) override { said += text + "\n"; }
  std::string said;
};

/// Keeps what it gets.
class Kept final : public Output {
 public:
  void take_volumes(const std::vector<VolumePlanes>& volumes) override {
    if (is_disk_full) throw OutputError("disk full");
    for (const VolumePlanes& volume : volumes) voxels.push_back(whole_volume(volume).voxels);
  }
  void take_mesh(const Mesh& mesh) override { faces = mesh.triangles.size(); }
  void finish() override { is_finished = true; }

  bool is_disk_full = false, is_finished = false;
  std::vector<std::vector<Voxel>> voxels;
  std::size_t faces = 0;
};

class BakeJob : public testing::Test {
 protected:
  [[nodiscard]] Job job(VolumeUse volumes = VolumeUse::kGrids) const {
    Options options;
    options.resolution = 24;
    Job made{field_, engines_, {}, options};
    made.volumes = volumes;
    made.journal = folder_ / "unfinished.bake";
    made.identity = "a ball";
    return made;
  }

  cnerf::test::TempDir folder_;
  AnalyticField field_{{{1, 2, 3}, 0.5, 1}, sphere_density({0.5f, 0.5f, 0.5f}, 0.3f, 60)};
  ProcessorAlone engines_;
};

TEST_F(BakeJob, GivesVolumesAndAMeshAndLeavesNoJournal) {
  Job both = job();
  both.mesh = MeshOptions{.faces = 500, .texture_size = 128};
  Kept kept;
  Listener listener;
  run(both, kept, listener);
  ASSERT_EQ(kept.voxels.size(), 1u);
  EXPECT_TRUE(std::ranges::any_of(kept.voxels[0], [](const Voxel& v) { return v.sigma == 0 && v.luminance > 0; }))
      << "colour reaches beyond density";
  EXPECT_GT(kept.faces, 100u);
  EXPECT_TRUE(kept.is_finished);
  EXPECT_FALSE(fs::exists(both.journal));
  EXPECT_NE(listener.said.find("24 x 24 x 24 voxels"), std::string::npos) << listener.said;
}

TEST_F(BakeJob, GoesOnWhereItWasStopped) {
  Kept whole, full, second;
  Listener listener;
  run(job(), whole, listener);
  full.is_disk_full = true;
  EXPECT_THROW(run(job(), full, listener), OutputError);
  EXPECT_TRUE(fs::exists(job().journal)) << "what is done is worth going on with";
  EXPECT_EQ(listener.said.find("going on"), std::string::npos);
  run(job(), second, listener);
  EXPECT_NE(listener.said.find("going on where it was stopped"), std::string::npos);
  EXPECT_EQ(second.voxels, whole.voxels);
  EXPECT_FALSE(fs::exists(job().journal));
}

TEST_F(BakeJob, AnotherIdentityBeginsAnew) {
  Kept full, second;
  Listener listener;
  full.is_disk_full = true;
  EXPECT_THROW(run(job(), full, listener), OutputError);
  Job other = job();
  other.options.dilation = 3;
  run(other, second, listener);
  EXPECT_EQ(listener.said.find("going on"), std::string::npos);
}

TEST_F(BakeJob, TheJournalGoesWithBadInput) {
  Job empty = job();
  empty.options.opacity_threshold = 1;
  Kept kept;
  Listener listener;
  EXPECT_THROW(run(empty, kept, listener), InputError);
  EXPECT_FALSE(fs::exists(empty.journal));
  EXPECT_FALSE(kept.is_finished);
}

}  // namespace
}  // namespace cnerf::bake::test
