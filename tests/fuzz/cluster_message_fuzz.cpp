/// What processes of a launch hand each other, and the variables by which a launcher tells them of each other. The
/// network is one that they trust, so that a message of another program is a bug; but it takes no more memory than it
/// has bytes, and reads none beyond.

#include <algorithm>
#include <map>
#include <optional>

#include "src/base/check.h"
#include "src/cluster/launch.h"
#include "src/cluster/packing.h"
#include "tests/fuzz/fuzz_target.h"

namespace {

using namespace cnerf;

/// A message by what it holds, value by value.
void unpack(fuzz::Bytes input) {
  cluster::Unpacker message(input);
  for (std::size_t i = 0; i < input.size(); ++i) {
    std::uint8_t kind = 0;
    std::uint64_t number = 0;
    std::string text;
    std::vector<double> numbers;
    message.get(kind);
    if (kind % 3 == 0) message.get(number);
    if (kind % 3 == 1) message.get(text);
    if (kind % 3 == 2) message.get(numbers);
    if (text.size() + numbers.size() * sizeof(double) > input.size()) {
      throw fuzz::Finding("more came out of a message than it holds");
    }
  }
}

/// Lines of NAME=value.
void launch(const std::string& text) {
  std::map<std::string, std::string> variables;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string line = text.substr(begin, end - begin);
    const std::size_t equals = std::min(line.find('='), line.size());
    variables[line.substr(0, equals)] = line.substr(std::min(equals + 1, line.size()));
    begin = end + 1;
  }
  const auto found = cluster::find_launch([&](const std::string& name) -> std::optional<std::string> {
    const auto variable = variables.find(name);
    if (variable == variables.end() || variable->second.empty()) return std::nullopt;
    return variable->second;
  });
  if (found && (found->rank < 0 || found->rank >= found->size || found->host.empty() || found->port < 1 ||
                found->port > 65535)) {
    throw fuzz::Finding("a launch in which nobody has a place");
  }
}

}  // namespace

CNERF_FUZZ_TARGET(cluster_message) {
  const bool is_launch = fuzz::take_byte(input) % 2 == 1;
  try {
    is_launch ? launch(fuzz::text_of(input)) : unpack(input);
  } catch (const ContractError&) {
    if (is_launch) throw;
  } catch (const UsageError&) {
    if (!is_launch) throw;
  }
}
