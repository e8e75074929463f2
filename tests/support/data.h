#pragma once
/// Where tests find real data and put temporary files.

#include <filesystem>
#include <optional>
#include <string>

namespace cnerf::test {

/// A file or folder of the shared test data: under $CNERF_DATA, else `../shared/data` beside the repository.
/// Nothing when it is missing; the test then skips with CNERF_REQUIRE_DATA's message.
[[nodiscard]] std::optional<std::filesystem::path> shared_data(const std::string& relative);

/// A fresh folder that is removed, with all it holds, at the end of the scope.
class TempDir {
 public:
  TempDir();
  ~TempDir();
  TempDir(const TempDir&) = delete;
  TempDir& operator=(const TempDir&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

}  // namespace cnerf::test

/// Declares `variable` as the path of shared data, or skips the test and says what was missing.
#define CNERF_REQUIRE_DATA(variable, relative)                                        \
  const auto variable##_found = ::cnerf::test::shared_data(relative);                 \
  if (!variable##_found) GTEST_SKIP() << "needs " << (relative) << " in $CNERF_DATA"; \
  const std::filesystem::path& variable = *variable##_found
