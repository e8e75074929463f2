/// Makes one of the fixtures of e2e tests anew:  e2e_fixture FOLDER capture|run|take|bake

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>

#include "tests/e2e/program.h"

int main(int argc, char** argv) {
  using Fixture = const std::filesystem::path& (*)();
  const std::map<std::string, Fixture> fixtures = {{"capture", cnerf::test::tiny_capture},
                                                   {"run", cnerf::test::tiny_run},
                                                   {"take", cnerf::test::tiny_take},
                                                   {"bake", cnerf::test::tiny_bake}};
  testing::InitGoogleTest(&argc, argv);
  if (argc != 3 || !fixtures.contains(argv[2])) {
    std::fputs("e2e_fixture FOLDER capture|run|take|bake\n", stderr);
    return 64;
  }
  std::filesystem::create_directories(argv[1]);
  std::filesystem::remove_all(std::filesystem::path(argv[1]) / argv[2]);
  ::setenv("CNERF_E2E", argv[1], 1);
  std::puts(fixtures.at(argv[2])().c_str());
  return testing::Test::HasFailure() ? EXIT_FAILURE : EXIT_SUCCESS;
}
