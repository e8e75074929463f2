#pragma once
/// An environment without the programs of the system.

#include <cstdlib>
#include <string>

namespace cnerf::test {

/// No program is found while it lives.
class NoPrograms {
 public:
  NoPrograms() { ::setenv("PATH", "/absent", 1); }
  ~NoPrograms() { ::setenv("PATH", path_.c_str(), 1); }
  NoPrograms(const NoPrograms&) = delete;
  NoPrograms& operator=(const NoPrograms&) = delete;

 private:
  std::string path_ = std::getenv("PATH");
};

}  // namespace cnerf::test
