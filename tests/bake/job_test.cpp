#include "bake/job/job.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <random>

#include "bake/density/density_pass.h"
#include "bake/out_of_core/journal.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "tests/bake/analytic_field.h"
#include "tests/bake/processor_alone.h"
#include "tests/cluster/fake_channel.h"
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
  [[nodiscard]] Job job(VolumeUse volumes = VolumeUse::kGrids, cluster::Ranks& ranks = cluster::alone()) const {
    Options options;
    options.resolution = resolution_;
    Job made{field_, engines_, {}, options, ranks};
    made.volumes = volumes;
    made.journal = folder_ / "unfinished.bake";
    made.identity = "a ball";
    return made;
  }

  int resolution_ = 24;
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

TEST_F(BakeJob, AMeshThatIsRefusedGivesNoVolumesEither) {
  Job both = job();
  both.mesh = MeshOptions{.faces = 500, .texture_size = 8};  // holds one chart at most
  Kept kept;
  Listener listener;
  EXPECT_THROW(run(both, kept, listener), UsageError);
  EXPECT_TRUE(kept.voxels.empty()) << "they would replace those of a former bake";
  EXPECT_TRUE(fs::exists(both.journal)) << "a larger texture goes on with it";
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

/// Bakes by three ranks; nothing but what rank 0 makes is kept.
Kept baked_by_ranks(const std::function<Job(cluster::Ranks&)>& job, std::string& said) {
  Kept first;
  cnerf::test::on_ranks(3, [&](cluster::Ranks& ranks) {
    Kept others;
    Listener listener;
    run(job(ranks), ranks.is_first() ? first : others, listener);
    EXPECT_EQ(others.is_finished, false);
    EXPECT_TRUE(others.voxels.empty());
    if (ranks.is_first()) said = listener.said;
  });
  return first;
}

TEST_F(BakeJob, RanksFindTheSameVoxelsAsOne) {
  Kept alone, stopped;
  Listener listener;
  run(job(), alone, listener);
  std::string said;
  const auto shared = [&](cluster::Ranks& ranks) { return job(VolumeUse::kGrids, ranks); };
  EXPECT_EQ(baked_by_ranks(shared, said).voxels, alone.voxels);
  EXPECT_FALSE(fs::exists(job().journal));

  // What one process left they go on with.
  stopped.is_disk_full = true;
  EXPECT_THROW(run(job(), stopped, listener), OutputError);
  EXPECT_EQ(baked_by_ranks(shared, said).voxels, alone.voxels);
  EXPECT_NE(said.find("going on where it was stopped"), std::string::npos) << said;
}

/// A journal of this bake with wrong values under right checksums, which is what a forger would hand over.
template <typename T>
void forge(const fs::path& file, std::size_t part, const std::function<void(std::vector<T>&)>& change) {
  const auto whole = read_binary_file(file);
  std::string identity;
  std::vector<std::vector<std::byte>> parts;
  for (std::size_t at = 0; at < whole.size();) {
    std::uint64_t bytes = 0;
    std::memcpy(&bytes, whole.data() + at, sizeof bytes);
    const auto begin = whole.begin() + std::ptrdiff_t(at + 16), end = begin + std::ptrdiff_t(bytes);
    if (at == 0) identity.assign(reinterpret_cast<const char*>(&*begin), bytes);
    if (at > 0) parts.emplace_back(begin, end);
    at += 16 + bytes;
  }
  fs::remove(file);
  Journal forged(file, identity);
  for (std::size_t p = 0; p < parts.size(); ++p) {
    std::vector<T> values(parts[p].size() / sizeof(T));
    if (!values.empty()) std::memcpy(values.data(), parts[p].data(), values.size() * sizeof(T));
    if (p == part) change(values);
    const auto bytes = std::as_bytes(std::span<const T>(values));
    forged.parts<std::byte>(
        p, 1, 1, [&](std::size_t) { return p == part ? std::vector<std::byte>(bytes.begin(), bytes.end()) : parts[p]; },
        [](std::size_t, const auto&) {});
  }
}

class ForgedJournal : public BakeJob {
 protected:
  ForgedJournal() { resolution_ = 16; }  // two planes of 2 x 2 bricks
  void SetUp() override {
    Listener listener;
    run(job(), whole_, listener);
    Kept full;
    full.is_disk_full = true;
    EXPECT_THROW(run(job(), full, listener), OutputError);
    journal_ = read_binary_file(job().journal);
  }
  /// A bake that finds this journal.  @return  what it said
  std::string bake_with(std::span<const std::byte> journal) {
    write_file(job().journal, journal);
    return bake();
  }
  std::string bake() {
    Kept kept;
    Listener listener;
    run(job(), kept, listener);
    EXPECT_EQ(kept.voxels, whole_.voxels);
    return listener.said;
  }
  template <typename T>
  std::string bake_forged(std::size_t part, const std::function<void(std::vector<T>&)>& change) {
    write_file(job().journal, journal_);
    forge<T>(job().journal, part, change);
    return bake();
  }

  Kept whole_;
  std::vector<std::byte> journal_;
};

TEST_F(ForgedJournal, RanksRefuseItTogether) {
  write_file(job().journal, journal_);
  forge<DenseVoxel>(job().journal, 1, [](std::vector<DenseVoxel>& v) { v.back().brick = 4; });
  std::string said;
  const Kept made = baked_by_ranks([&](cluster::Ranks& ranks) { return job(VolumeUse::kGrids, ranks); }, said);
  EXPECT_EQ(made.voxels, whole_.voxels);
  EXPECT_NE(said.find("starting anew"), std::string::npos) << said;
}

TEST_F(ForgedJournal, ValuesThatNoBakeMakesBeginAnew) {
  const auto refused = testing::HasSubstr("starting anew");
  using Dense = std::vector<DenseVoxel>;
  EXPECT_THAT(bake_forged<DenseVoxel>(1, [](Dense& v) { v.at(0).brick = 1u << 31; }), refused);
  EXPECT_THAT(bake_forged<DenseVoxel>(1, [](Dense& v) { v.back().brick = 4; }), refused);
  EXPECT_THAT(bake_forged<DenseVoxel>(1, [](Dense& v) { v.back().offset = 512; }), refused);
  EXPECT_THAT(bake_forged<DenseVoxel>(1, [](Dense& v) { v.at(3).sigma = std::nanf(""); }), refused);
  EXPECT_THAT(bake_forged<DenseVoxel>(1, [](Dense& v) { v.at(3).sigma = -1; }), refused);
  EXPECT_THAT(bake_forged<DenseVoxel>(1, [](Dense& v) { v.at(3) = v.at(2); }), refused) << "twice the same place";
  EXPECT_THAT(bake_forged<std::byte>(1, [](std::vector<std::byte>& v) { v.pop_back(); }), refused);
  using Voxels = std::vector<Voxel>;
  EXPECT_THAT(bake_forged<Voxel>(3, [](Voxels& v) { v.at(0).i = -2'139'160'079; }), refused);
  EXPECT_THAT(bake_forged<Voxel>(3, [](Voxels& v) { v.back().k = 16; }), refused);
  EXPECT_THAT(bake_forged<Voxel>(3, [](Voxels& v) { v.at(0).rgb.x = std::numeric_limits<float>::infinity(); }),
              refused);
  EXPECT_THAT(bake_forged<Voxel>(3, [](Voxels& v) { std::swap(v.at(0), v.at(1)); }), refused);
  EXPECT_THAT(bake_forged<std::byte>(3, [](std::vector<std::byte>& v) { v.resize(v.size() + 4); }), refused);
}

/// Mutants of a journal, as a failing disk or a hand makes them: each bake ends with what an undisturbed one does.
TEST_F(ForgedJournal, MutantsChangeNothing) {
  std::mt19937 random(1);
  const auto below = [&](std::size_t n) { return std::uniform_int_distribution<std::size_t>(0, n - 1)(random); };
  for (int mutant = 0; mutant < 80; ++mutant) {
    std::vector<std::byte> bytes = journal_;
    for (std::size_t change = 0; change <= below(3); ++change) {
      const std::size_t at = below(bytes.size()), other = below(bytes.size());
      const std::size_t length = 1 + below(std::min<std::size_t>(64, bytes.size() - std::max(at, other)));
      switch (below(5)) {
        case 0:
          bytes[at] ^= std::byte(1u << below(8));
          break;
        case 1:
          bytes.resize(std::max<std::size_t>(at, 1));
          break;
        case 2:  // sizes and indices of all ones, zeros
          std::fill_n(bytes.begin() + std::ptrdiff_t(at), length, below(2) == 0 ? std::byte{0xff} : std::byte{0});
          break;
        case 3:
          std::copy_n(journal_.begin() + std::ptrdiff_t(std::min(other, journal_.size() - length)), length,
                      bytes.begin() + std::ptrdiff_t(at));
          break;
        default:
          bytes.erase(bytes.begin() + std::ptrdiff_t(at), bytes.begin() + std::ptrdiff_t(at + length));
      }
      if (bytes.empty()) break;
    }
    (void)bake_with(bytes);
    if (HasFailure()) FAIL() << "mutant " << mutant;
  }
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
