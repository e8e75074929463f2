/// The main of every test executable. CTest runs one suite per process, so this checks and counts what one process did:
///
///   $CNERF_SUITES  suites that CTest runs, separated by colons; another one in the executable is a failure
///   $CNERF_CASES   file for the counts, which scripts/test.sh adds up
///
/// Exit code 77, which CTest shows as skipped, where every case was skipped.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

namespace {

constexpr int kAllSkipped = 77;

/// The name in the source of "Instance/Suite" and "Suite/0".
std::string source_name(std::string name) {
  const auto is_digit = [](unsigned char c) { return std::isdigit(c) != 0; };
  if (const auto slash = name.rfind('/');
      slash != std::string::npos && std::all_of(name.begin() + long(slash) + 1, name.end(), is_digit)) {
    name.resize(slash);
  }
  return name.substr(name.rfind('/') + 1);  // all of it where there is none
}

/// Whether CTest runs every suite of this executable.
bool is_complete() {
  const testing::UnitTest& tests = *testing::UnitTest::GetInstance();
  const char* listed = std::getenv("CNERF_SUITES");
  if (listed == nullptr) return true;
  std::vector<std::string> known;
  std::istringstream names(listed);
  for (std::string name; std::getline(names, name, ':');) known.push_back(name);
  for (int i = 0; i < tests.total_test_suite_count(); ++i) {
    const std::string name = source_name(tests.GetTestSuite(i)->name());
    if (name.starts_with("GoogleTest") || std::ranges::find(known, name) != known.end()) continue;
    std::fprintf(stderr, "suite %s is not run by CTest: configure again\n", name.c_str());
    return false;
  }
  return true;
}

/// A line with the counts, then one for each skipped case with its reason.
void write_counts() {
  const char* file = std::getenv("CNERF_CASES");
  if (file == nullptr) return;
  const testing::UnitTest& tests = *testing::UnitTest::GetInstance();
  std::filesystem::create_directories(std::filesystem::path(file).parent_path());
  std::ofstream out(file);
  out << "cases " << tests.successful_test_count() << ' ' << tests.skipped_test_count() << ' '
      << tests.failed_test_count() << '\n';
  for (int s = 0; s < tests.total_test_suite_count(); ++s) {
    const testing::TestSuite& suite = *tests.GetTestSuite(s);
    for (int i = 0; i < suite.total_test_count(); ++i) {
      const testing::TestInfo& test = *suite.GetTestInfo(i);
      if (!test.should_run() || !test.result()->Skipped()) continue;
      std::string reason;
      for (int part = 0; part < test.result()->total_part_count(); ++part) {
        if (test.result()->GetTestPartResult(part).skipped()) reason = test.result()->GetTestPartResult(part).message();
      }
      std::ranges::replace(reason, '\n', ' ');
      out << "skipped " << suite.name() << '.' << test.name() << ": " << reason << '\n';
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleMock(&argc, argv);
  const bool lists = testing::GTEST_FLAG(list_tests);
  if (!lists && !is_complete()) return EXIT_FAILURE;
  const int code = RUN_ALL_TESTS();
  if (lists) return code;
  write_counts();
  const testing::UnitTest& tests = *testing::UnitTest::GetInstance();
  if (tests.test_to_run_count() == 0) {
    std::fprintf(stderr, "the filter matches no case: configure again\n");
    return EXIT_FAILURE;
  }
  const bool all_skipped = tests.skipped_test_count() > 0 && tests.skipped_test_count() == tests.test_to_run_count();
  return code == 0 && all_skipped ? kAllSkipped : code;
}
