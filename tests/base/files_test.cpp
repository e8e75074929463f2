#include "src/base/files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <stdexcept>

#include "src/base/error.h"
#include "src/base/folder_lock.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

std::size_t entries(const fs::path& folder) {
  return std::size_t(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

std::string hash_of(std::string_view text) {
  return sha256(std::as_bytes(std::span(text.data(), text.size())));
}

TEST(Files, ChecksumOfAFileIsThatOfItsContent) {
  const test::TempDir folder;
  for (const std::size_t bytes : {std::size_t(0), std::size_t(5), std::size_t(1) << 20, (std::size_t(3) << 20) + 7}) {
    std::string text(bytes, 'x');
    if (bytes > 0) text.back() = 'y';
    write_file(folder / "a", text);
    EXPECT_EQ(sha256_of_file(folder / "a"), hash_of(text)) << bytes << " bytes: pieces of it are read";
  }
  EXPECT_THROW((void)sha256_of_file(folder / "missing"), MissingInputError);
}

TEST(Files, WritesAndReadsBack) {
  const test::TempDir folder;
  write_file(folder / "deep/er/a.txt", "grey\n");
  EXPECT_EQ(read_text_file(folder / "deep/er/a.txt"), "grey\n");
  EXPECT_EQ(entries(folder / "deep/er"), 1u);
}

TEST(Files, BytesSurviveIncludingZeros) {
  const test::TempDir folder;
  const std::vector<std::byte> content = {std::byte{0}, std::byte{255}, std::byte{'\n'}, std::byte{0}};
  write_file(folder / "a.bin", content);
  EXPECT_EQ(read_binary_file(folder / "a.bin"), content);
}

TEST(Files, FailureLeavesNothingBehind) {
  const test::TempDir folder;
  EXPECT_THROW(write_atomically(folder / "new.txt",
                                [](const fs::path& temporary) {
                                  std::ofstream(temporary) << "half";
                                  throw std::runtime_error("disk full");
                                }),
               std::runtime_error);
  EXPECT_EQ(entries(folder.path()), 0u);
}

TEST(Files, FailureKeepsTheOldFile) {
  const test::TempDir folder;
  write_file(folder / "a.txt", "old");
  EXPECT_THROW(write_atomically(folder / "a.txt",
                                [](const fs::path& temporary) {
                                  std::ofstream(temporary) << "new";
                                  throw std::runtime_error("disk full");
                                }),
               std::runtime_error);
  EXPECT_EQ(read_text_file(folder / "a.txt"), "old");
  EXPECT_EQ(entries(folder.path()), 1u);
}

TEST(Files, TemporaryNameIsAnotherOneWithTheSameExtension) {
  const test::TempDir folder;
  write_atomically(folder / "a.exr", [&](const fs::path& temporary) {
    EXPECT_NE(temporary, folder / "a.exr");
    EXPECT_EQ(temporary.parent_path(), folder.path());
    EXPECT_EQ(temporary.extension(), ".exr");
    std::ofstream(temporary) << "x";
  });
}

TEST(Files, WhatAKilledWriterLeftGoesAndWhatIsBeingWrittenStays) {
  const test::TempDir folder;
  write_file(folder / "a/b/.hidden", "a user's");
  const fs::path left = folder / "a/b/.x.partial-4194304.exr";
  std::ofstream(left) << "half";
  NewFile alive(folder / "a/b/y.exr");
  std::ofstream(alive.temporary()) << "whole";

  remove_leftovers(folder.path(), 1);
  EXPECT_TRUE(fs::exists(left)) << "deeper than asked";
  remove_leftovers(folder.path(), 2);
  EXPECT_FALSE(fs::exists(left));
  EXPECT_TRUE(fs::exists(folder / "a/b/.hidden"));
  alive.commit();
  EXPECT_EQ(read_text_file(folder / "a/b/y.exr"), "whole");
  EXPECT_EQ(entries(folder / "a/b"), 2u);
}

TEST(Files, AKilledHoldersLockGoesAndAHeldOneStays) {
  const test::TempDir folder;
  write_file(folder / "killed/.cnerf.lock", "pid 4194304, `cnerf render ...`");
  write_file(folder / "beginning/.cnerf.lock", "");
  const FolderLock own(folder.path(), FolderLock::Mode::kShared), other(folder / "held");
  remove_leftovers(folder.path(), 1);
  EXPECT_FALSE(fs::exists(folder / "killed/.cnerf.lock"));
  EXPECT_TRUE(fs::exists(folder / "beginning/.cnerf.lock")) << "somebody is about to take it";
  EXPECT_TRUE(fs::exists(folder / "held/.cnerf.lock"));
  EXPECT_TRUE(fs::exists(folder / ".cnerf.lock"));
}

TEST(Files, WhatIsAnotherFilesIsNoLeftover) {
  const test::TempDir folder;
  write_file(folder / "other/file", "kept");
  fs::create_symlink(folder / "other/file", folder / ".x.partial-4194304.txt");
  fs::create_directory_symlink(folder / "other", folder / "link");
  std::ofstream(folder / "other/.x.partial-4194304.txt") << "half";
  remove_leftovers(folder.path(), 0);
  EXPECT_EQ(read_text_file(folder / "other/file"), "kept");
  EXPECT_TRUE(fs::exists(folder / "other/.x.partial-4194304.txt")) << "links are not followed";
}

TEST(Files, MakesFoldersAndSaysWhichAreNew) {
  const test::TempDir folder;
  EXPECT_TRUE(make_folders(folder / "a/b/c/"));
  EXPECT_FALSE(make_folders(folder / "a/b/c"));
  EXPECT_THROW((void)make_folders(""), OutputError);
}

TEST(Files, WriterThatWritesNothingIsAnOutputError) {
  const test::TempDir folder;
  EXPECT_THROW(write_atomically(folder / "a.txt", [](const fs::path&) {}), OutputError);
}

TEST(Files, FolderThatCannotBeMadeIsAnOutputError) {
  const test::TempDir folder;
  write_file(folder / "file", "in the way");
  EXPECT_THROW(write_file(folder / "file/a.txt", "x"), OutputError);
}

TEST(Files, MissingFileAndFolderAreNamed) {
  const test::TempDir folder;
  try {
    (void)read_text_file(folder / "none.txt");
    FAIL() << "no error";
  } catch (const MissingInputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("none.txt"));
    EXPECT_EQ(error.exit_code(), ExitCode::kMissingInput);
  }
  EXPECT_THROW((void)read_binary_file(folder.path()), InputError);
}

TEST(Files, WhatMayNeverEndIsNotRead) {
  const test::TempDir folder;
  EXPECT_THROW((void)read_binary_file("/dev/null"), InputError);
  ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
  EXPECT_THROW((void)read_text_file(folder / "pipe"), InputError);
  EXPECT_THROW((void)sha256_of_file(folder / "pipe"), InputError);
}

TEST(Files, Sha256OfKnownVectors) {  // FIPS 180-4, examples
  EXPECT_EQ(hash_of("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(hash_of(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

}  // namespace
}  // namespace cnerf
