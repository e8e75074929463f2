#pragma once
/// The servers of `cnerf view` and `--view` under clients that are hostile, slow, or many, while somebody else looks at
/// the page.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "tests/mutants/limited_run.h"

namespace cnerf::mutants {

struct ServerOptions {
  std::uint64_t seed = 1;
  std::filesystem::path program, folder;
  int slow = 1000;                                  ///< sockets that send a byte a second
  int silent = 1000;                                ///< sockets that send nothing
  int streams = 500;                                ///< followers of a training
  int aborts = 500;                                 ///< clients that go in the middle of an answer
  int garbage = 10'000;                             ///< requests that are none
  int seconds = 20;                                 ///< that slow and silent ones and followers stay
  double patience = 1;                              ///< seconds in which the page has to come
  std::size_t most_growth = std::size_t(50) << 20;  ///< bytes, resident
  Limits limits;                                    ///< of the commands that make what is served
  std::function<void(const std::string&)> say = [](const std::string&) {};
};

/// What came of a part of the campaign.
struct ServerRow {
  std::string part;
  std::size_t clients = 0, served = 0, refused = 0, unanswered = 0;
  std::size_t leaks = 0;   ///< answers that hold what lies outside the bundle
  std::size_t wrong = 0;   ///< answers that should not have been given
  std::size_t visits = 0;  ///< of the page meanwhile
  std::size_t failed_visits = 0;
  std::string first_failure;
  double slowest_visit = 0;  ///< seconds
  std::size_t growth = 0;    ///< bytes beyond what the server held before, at most
  std::size_t descriptors_before = 0, descriptors_after = 0;
  std::vector<std::string> violations = {};
};

/// @throws Error  when the server cannot be started.
[[nodiscard]] std::vector<ServerRow> run_server_campaign(const ServerOptions& options);

[[nodiscard]] std::string table_of(const std::vector<ServerRow>& rows);

}  // namespace cnerf::mutants
