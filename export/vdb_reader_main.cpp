/// cnerf-vdb-reader summary|volume FILE: reads a VDB file where a crash, a hang or much memory harms nobody, and
/// answers on its standard output as vdb_answer.h says. A part of the program, not for users.

#include <sys/resource.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <new>
#include <span>
#include <string>

#include "export/vdb_answer.h"
#include "export/vdb_file.h"
#include "export/vdb_limits.h"
#include "src/base/error.h"
#include "src/base/json_record.h"

namespace cnerf::exporting {
namespace {

template <typename Resource>
void limit(Resource resource, rlim_t most) {
  rlimit now{};
  ::getrlimit(resource, &now);
  now.rlim_cur = std::min(most, now.rlim_max);
  ::setrlimit(resource, &now);
}

/// What is mapped already: libraries for the most part.
std::uint64_t mapped_bytes() {
  std::ifstream statm("/proc/self/statm");
  std::uint64_t pages = 0;
  statm >> pages;
  return pages * std::uint64_t(::sysconf(_SC_PAGESIZE));
}

void write_all(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ::ssize_t put = ::write(STDOUT_FILENO, bytes.data(), bytes.size());
    if (put < 0 && errno == EINTR) continue;
    if (put <= 0) ::_exit(1);  // nobody listens any more
    bytes = bytes.subspan(std::size_t(put));
  }
}

template <typename T>
void write_value(const T& value) {
  write_all(std::as_bytes(std::span(&value, 1)));
}

void answer(int status, const std::string& text) {
  const std::string_view said = std::string_view(text).substr(0, kLongestText);
  write_value(VdbAnswerHeader{.status = status, .bytes = said.size()});
  write_all(std::as_bytes(std::span(said)));
}

void answer(const bake::Volume& volume) {
  const std::span<const bake::Voxel> voxels = volume.voxels;
  write_value(VdbAnswerHeader{.bytes = sizeof(VdbVolumeHeader) + voxels.size_bytes()});
  write_value(static_cast<const VdbVolumeHeader&>(volume));
  write_all(std::as_bytes(voxels));
}

void read(const std::string& what, const std::filesystem::path& file) {
  if (what == "volume") return answer(volume_in(file));
  // Text in a file is anybody's; JSON holds UTF-8 only.
  answer(0, json_of(summary_in(file)).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
}

int guarded_main(const std::string& what, const std::filesystem::path& file) {
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  const VdbLimits limits = limits_of(what == "summary", file);
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_FSIZE, 0);
  limit(RLIMIT_CPU, rlim_t(limits.cpu.count()));
  limit(RLIMIT_AS, mapped_bytes() + limits.memory_bytes);
  try {
    read(what, file);
  } catch (const Error& error) {
    answer(int(error.exit_code()), error.what());
  } catch (const std::bad_alloc&) {
    answer(int(ExitCode::kInput), file.string() + ": takes more than " + std::to_string(limits.memory_bytes >> 20) +
                                      " MiB to read, more than a sound file of its size");
  } catch (const std::exception& error) {
    answer(int(ExitCode::kInput), file.string() + ": not a readable OpenVDB file: " + error.what());
  }
  return 0;
}

}  // namespace
}  // namespace cnerf::exporting

int main(int argc, char** argv) {
  if (argc != 3) return 64;
  const int status = cnerf::exporting::guarded_main(argv[1], argv[2]);
  ::_exit(status);  // what was answered is answered: destructors of a damaged heap are not run
}
