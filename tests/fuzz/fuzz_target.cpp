#include "tests/fuzz/fuzz_target.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>

namespace cnerf::fuzz {
namespace {
namespace fs = std::filesystem;

struct Scratch {
  Scratch() {
    const char* wanted = std::getenv("TMPDIR");
    std::error_code failure;
    const fs::path memory = "/dev/shm";
    const fs::path base = wanted != nullptr                   ? fs::path(wanted)
                          : fs::is_directory(memory, failure) ? memory
                                                              : fs::temp_directory_path();
    std::string name = (base / "cnerf-fuzz-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error(name + ": cannot be made");
    folder = name;
  }
  ~Scratch() {
    std::error_code ignored;
    fs::remove_all(folder, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

  fs::path folder;
};

}  // namespace

std::vector<Target>& targets() {
  static std::vector<Target> all;
  return all;
}

const fs::path& scratch_folder() {
  static const Scratch scratch;
  return scratch.folder;
}

fs::path scratch_file(const std::string& name, Bytes content) {
  fs::path file = scratch_folder() / name;
  constexpr int kFlags = O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC;
  int descriptor = ::open(file.c_str(), kFlags, 0600);
  if (descriptor < 0 && errno == ENOENT) {
    std::error_code failure;
    fs::create_directories(file.parent_path(), failure);
    descriptor = ::open(file.c_str(), kFlags, 0600);
  }
  bool is_written = descriptor >= 0;
  for (Bytes rest = content; is_written && !rest.empty();) {
    const ::ssize_t put = ::write(descriptor, rest.data(), rest.size());
    is_written = put > 0;
    if (is_written) rest = rest.subspan(std::size_t(put));
  }
  if (descriptor >= 0) ::close(descriptor);
  if (!is_written) throw std::runtime_error(file.string() + ": cannot be written");
  return file;
}

std::vector<Bytes> pieces_of(Bytes input, std::size_t count) {
  constexpr std::string_view kMark = "\n--\n";
  std::vector<Bytes> pieces;
  std::string_view rest(reinterpret_cast<const char*>(input.data()), input.size());
  while (pieces.size() + 1 < count) {
    const std::size_t at = rest.find(kMark);
    if (at == rest.npos) break;
    pieces.push_back(bytes_of(rest.substr(0, at)));
    rest.remove_prefix(at + kMark.size());
  }
  pieces.push_back(bytes_of(rest));
  pieces.resize(count);
  return pieces;
}

}  // namespace cnerf::fuzz
