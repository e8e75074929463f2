#include "src/pipeline/facts.h"

#include <dlfcn.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "tests/support/data.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;
namespace {
using testing::HasSubstr;
using testing::ThrowsMessage;

std::string text_of(const std::vector<Fact>& facts) {
  std::string text;
  for (const auto& [name, value] : facts) text += name + ": " + value + "\n";
  return text;
}

TEST(Facts, PhotographsWithoutPosesAreCountedAndMeasured) {
  const test::TempDir folder;
  for (const char* name : {"a.png", "b.png", "c.png"}) cv::imwrite(folder / name, cv::Mat1w(30, 40, std::uint16_t(9)));
  const std::string text = text_of(facts_of(folder.path(), {}));
  EXPECT_THAT(text, HasSubstr("photographs: 3 in " + folder.path().string()));
  EXPECT_THAT(text, HasSubstr("images: 40x30, 16-bit"));
  EXPECT_THAT(text, HasSubstr("cameras: not known yet"));
}

TEST(Facts, AClipIsNamedAsSuch) {
  const test::TempDir folder;
  const std::string clip = (folder / "clip.avi").string();
  cv::VideoWriter writer(clip, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25, {64, 48});
  if (!writer.isOpened()) GTEST_SKIP() << "OpenCV cannot write clips here";
  for (int i = 0; i < 5; ++i) writer.write(cv::Mat3b(48, 64, cv::Vec3b(9, 9, 9)));
  writer.release();
  const std::string text = text_of(facts_of(clip, {}));
  EXPECT_THAT(text, HasSubstr("clip: " + clip));
  EXPECT_THAT(text, HasSubstr("cameras: not known yet"));
}

TEST(Facts, LibTorchCallsTheBlasThatTheSystemHasChosen) {
  void* chosen = ::dlopen("libblas.so.3", RTLD_LAZY);
  if (chosen == nullptr) GTEST_SKIP() << "no libblas.so.3 here";
  Dl_info source{};
  ASSERT_NE(::dladdr(::dlsym(chosen, "sgemm_"), &source), 0);
  EXPECT_THAT(text_of(facts_of_machine()), HasSubstr("BLAS: " + fs::canonical(source.dli_fname).string()));
}

TEST(Facts, AFolderOfNothingIsRefused) {
  const test::TempDir folder;
  write_file(folder / "notes.txt", "nothing");
  EXPECT_THAT([&] { (void)facts_of(folder.path(), {}); },
              ThrowsMessage<MissingInputError>(HasSubstr(folder.path().string())));
}

}  // namespace
}  // namespace cnerf::pipeline
