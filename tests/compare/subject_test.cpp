#include "src/compare/subject.h"

#include <gtest/gtest.h>

#include <system_error>

#include "src/sample/sample_scene.h"
#include "tests/support/data.h"
#include "tests/support/json_file.h"

namespace cnerf::compare {
namespace {
namespace fs = std::filesystem;

/// Whether this process holds a file open in a folder, be it one without a name.
bool has_open_file_in(const fs::path& folder) {
  std::error_code failure;
  for (const fs::directory_entry& each : fs::directory_iterator("/proc/self/fd")) {
    if (fs::read_symlink(each.path(), failure).parent_path() == folder) return true;
  }
  return false;
}

TEST(Subjects, PhotographsBeyondTheirMemoryLieInAFileOfTheReport) {
  const test::TempDir folder;
  const fs::path capture = folder / "capture", report = folder / "report";
  write_sample_scene(capture, {.views = 9, .width = 48, .height = 36, .samples_per_pixel = 1});
  auto poses = test::json_of(capture / "transforms.json");
  const auto split = poses;
  poses.erase("train_filenames");
  poses.erase("test_filenames");
  fs::create_directory(report);
  Config config;
  config.image_memory = "4k";
  Observer observer;
  for (const auto& content : {split, poses}) {
    write_file(capture / "transforms.json", content.dump());
    const auto subjects = read_subjects({{capture}}, config, observer, report);
    EXPECT_EQ(subjects[0]->evaluated.size(), 2u) << "the first and the ninth, by the split or without one";
    for (const View& view : subjects[0]->capture.views) EXPECT_TRUE(view.image.u8.is_in_file()) << view.name;
    EXPECT_TRUE(has_open_file_in(fs::canonical(report)));
  }
}

}  // namespace
}  // namespace cnerf::compare
