#include "src/base/folder_lock.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include <functional>
#include <optional>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/process.h"
#include "tests/support/data.h"

namespace cnerf::test {
namespace {
namespace fs = std::filesystem;
using Mode = FolderLock::Mode;

/// Another process that does something, says so, and lives until this object goes.
class Other {
 public:
  explicit Other(const std::function<void()>& work) {
    int said[2];
    EXPECT_EQ(::pipe(said), 0);
    child_ = ::fork();
    if (child_ == 0) {
      char word = 'd';
      try {
        work();
      } catch (const std::exception&) {
        word = 'f';
      }
      (void)!::write(said[1], &word, 1);
      ::pause();
      ::_exit(0);
    }
    char word = 0;
    EXPECT_EQ(::read(said[0], &word, 1), 1);
    did_it_ = word == 'd';
    ::close(said[0]);
    ::close(said[1]);
  }
  ~Other() { kill(); }
  Other(const Other&) = delete;
  Other& operator=(const Other&) = delete;
  void kill() {
    if (child_ > 0) ::kill(child_, SIGKILL), ::waitpid(child_, nullptr, 0);
    child_ = -1;
  }
  [[nodiscard]] bool did_it() const { return did_it_; }
  [[nodiscard]] pid_t pid() const { return child_; }

 private:
  pid_t child_ = -1;
  bool did_it_ = false;
};

std::string refusal(const fs::path& folder, Mode mode = Mode::kAlone) {
  try {
    const FolderLock lock(folder, mode);
    return "";
  } catch (const BusyError& error) {
    return error.what();
  }
}

TEST(FolderLock, ASecondWriterIsRefusedAndToldWhoWorksThere) {
  const TempDir folder;
  Other first([&] { new FolderLock(folder.path()); });
  const std::string said = refusal(folder.path());
  EXPECT_THAT(said, testing::HasSubstr("pid " + std::to_string(first.pid())));
  EXPECT_THAT(said, testing::HasSubstr("base_test"));
  EXPECT_THAT(said, testing::HasSubstr(folder.path().string()));
  first.kill();
  EXPECT_EQ(refusal(folder.path()), "") << "who died let go, though its file is still there";
  EXPECT_TRUE(fs::is_empty(folder.path())) << "who ends properly leaves nothing";
}

TEST(FolderLock, ThoseWhoShareDoNotStopEachOtherButWhoWantsItAlone) {
  const TempDir folder;
  const Other first([&] { new FolderLock(folder.path(), Mode::kShared); });
  const Other second([&] { new FolderLock(folder.path(), Mode::kShared); });
  EXPECT_TRUE(first.did_it() && second.did_it());
  EXPECT_EQ(refusal(folder.path(), Mode::kShared), "");
  EXPECT_NE(refusal(folder.path(), Mode::kAlone), "");
}

/// Whether nobody, this process included, holds a folder.
bool is_free(const fs::path& folder) {
  const FileDescriptor file(::open((folder / FolderLock::kFile).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644));
  return ::flock(file.number(), LOCK_EX | LOCK_NB) == 0;
}

TEST(FolderLock, OneProcessMayHoldAFolderTwice) {
  const TempDir folder;
  std::optional<FolderLock> outer(std::in_place, folder.path());
  {
    const FolderLock inner(folder.path(), Mode::kShared);
    outer.reset();
    EXPECT_FALSE(is_free(folder.path())) << "the inner one still holds it";
  }
  EXPECT_TRUE(is_free(folder.path()));
}

TEST(FolderLock, OneOfManyWinsAtATime) {
  const TempDir folder;
  for (int round = 0; round < 20; ++round) {
    int winners = 0;
    std::vector<std::unique_ptr<Other>> all;
    for (int i = 0; i < 4; ++i) all.push_back(std::make_unique<Other>([&] { new FolderLock(folder.path()); }));
    for (const auto& each : all) winners += each->did_it() ? 1 : 0;
    EXPECT_EQ(winners, 1);
  }
}

TEST(FolderLock, WhatALockFileSaysIsPrintable) {
  const TempDir folder;
  const Other first([&] {
    new FolderLock(folder.path());
    write_file(folder / "text", std::string_view("\x1b[2Jevil\n"));
    fs::copy_file(folder / "text", folder / FolderLock::kFile, fs::copy_options::overwrite_existing);
  });
  EXPECT_THAT(refusal(folder.path()), testing::HasSubstr("(?[2Jevil?)"));
}

TEST(FolderLock, PlacesThatCannotBeWrittenAreOutputErrors) {
  const TempDir folder;
  write_file(folder / "file", std::string_view("no folder"));
  EXPECT_THROW(FolderLock(folder / "file"), OutputError);
  EXPECT_THROW(FolderLock("/proc/cnerf"), OutputError);
  fs::create_symlink(folder / "file", folder / FolderLock::kFile);
  EXPECT_THROW(FolderLock(folder.path()), OutputError) << "a link is not followed";
  EXPECT_EQ(read_text_file(folder / "file"), "no folder");
}

TEST(FolderLock, AFolderWithALockAloneIsVacant) {
  const TempDir folder;
  EXPECT_TRUE(is_vacant(folder / "missing"));
  const FolderLock lock(folder.path());
  EXPECT_TRUE(is_vacant(folder.path()));
  write_file(folder / "file", std::string_view("x"));
  EXPECT_FALSE(is_vacant(folder.path()));
  EXPECT_FALSE(is_vacant(folder / "file"));
  EXPECT_TRUE(is_vacant(folder.path(), {"file"})) << "one began here";
  write_file(folder / "begun/.x.partial-7.toml", std::string_view("half"));
  EXPECT_TRUE(is_vacant(folder / "begun"));
  EXPECT_FALSE(is_vacant(folder.path(), {"file"}));
}

TEST(FolderLock, WhoClearsAFolderKeepsItsLock) {
  const TempDir folder;
  fs::create_directories(folder / "made");
  {
    const FolderLock lock(folder / "made"), other(folder / "new");
    write_file(folder / "made" / "deep" / "file", std::string_view("x"));
    clear_folder(folder / "made");
    EXPECT_FALSE(fs::exists(folder / "made" / "deep"));
    EXPECT_FALSE(is_free(folder / "made"));
  }
  EXPECT_TRUE(fs::exists(folder / "made"));
  EXPECT_FALSE(fs::exists(folder / "new")) << "it was made for nothing";
}

TEST(FolderLock, ChangesOfARecordTakeTurns) {
  const TempDir folder;
  write_file(folder / "count", std::string_view("0"));
  std::vector<pid_t> children;
  for (int i = 0; i < 4; ++i) {
    const pid_t child = ::fork();
    if (child == 0) {
      for (int n = 0; n < 50; ++n) {
        const RecordTurn turn(folder.path());
        write_file(folder / "count", std::to_string(std::stoi(read_text_file(folder / "count")) + 1));
      }
      ::_exit(0);
    }
    children.push_back(child);
  }
  for (const pid_t child : children) ::waitpid(child, nullptr, 0);
  EXPECT_EQ(read_text_file(folder / "count"), "200");
}

}  // namespace
}  // namespace cnerf::test
