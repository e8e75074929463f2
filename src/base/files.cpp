#include "src/base/files.h"

#include <fcntl.h>
#include <openssl/evp.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <memory>
#include <system_error>

#include "src/base/error.h"
#include "src/base/folder_lock.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

std::ifstream opened(const fs::path& file) {
  std::error_code failure;
  if (!fs::exists(file, failure)) throw MissingInputError(file.string() + ": no such file");
  if (!fs::is_regular_file(file, failure)) {
    throw InputError(file, "", "expected a file, found a folder, pipe or device");  // a pipe might never end
  }
  std::ifstream in(file, std::ios::binary);
  if (!in) throw InputError(file.string() + ": cannot be opened");
  return in;
}

/// OpenSSL's, of content that comes in pieces.
class Sha256 {
 public:
  Sha256() : context_(EVP_MD_CTX_new(), EVP_MD_CTX_free) {
    check(EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr));
  }
  void add(std::span<const std::byte> piece) { check(EVP_DigestUpdate(context_.get(), piece.data(), piece.size())); }
  /// Ends it.
  [[nodiscard]] std::string hex() {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
    unsigned int size = 0;
    check(EVP_DigestFinal_ex(context_.get(), digest.data(), &size));
    std::string hex;
    for (unsigned int i = 0; i < size; ++i) {
      char text[3];
      std::snprintf(text, sizeof text, "%02x", digest[i]);
      hex += text;
    }
    return hex;
  }

 private:
  static void check(int succeeded) {
    if (succeeded != 1) throw DeviceError("SHA-256 is not available in this OpenSSL");
  }
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context_;
};

constexpr const char* kMark = ".partial-";  // in the names of temporary files

/// The time of a temporary file that nobody has opened for writing yet.
constexpr ::timespec kUntouched[2] = {{0, 0}, {0, 0}};

OutputError cannot_be_written(const fs::path& file) {
  return OutputError(file.string() + ": cannot be written: " + std::strerror(errno));
}

/// The folder that a name is in.
fs::path folder_of(const fs::path& path) {
  const fs::path folder = path.parent_path();
  return folder.empty() ? fs::path(".") : folder;
}

/// Waits until the content is on the disk. False with errno; what cannot be synchronised (a pipe, some network shares)
/// has nothing to wait for.
bool synced(const FileDescriptor& file) {
  return ::fsync(file.number()) == 0 || errno == EINVAL || errno == ENOTSUP || errno == EROFS;
}

/// Waits until the names in a folder are on the disk.
void sync_folder(const fs::path& folder) {
  const FileDescriptor file(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (file.number() >= 0 && !synced(file)) throw cannot_be_written(folder);  // without leave to read it, nothing to do
}

}  // namespace

NewFile::NewFile(fs::path target)
    : target_(std::move(target)),
      temporary_(target_.parent_path() /
                 ("." + target_.stem().string() + kMark + std::to_string(::getpid()) + target_.extension().string())) {
  if (target_.has_parent_path()) make_folders(target_.parent_path());
  bool is_locked = true;
  do {
    file_.reset(::open(temporary_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0666));
    if (file_.number() < 0) throw cannot_be_written(target_);
    is_locked = file_.lock(LOCK_EX);                      // false where there are no locks
  } while (is_locked && !file_.is_still_at(temporary_));  // somebody took it for a leftover in between
  (void)::futimens(file_.number(), kUntouched);
}

NewFile::~NewFile() {
  if (!is_committed_) ::unlink(temporary_.c_str());
}

void NewFile::commit() {
  struct stat state {};
  if (::fstat(file_.number(), &state) == 0 && state.st_mtime == 0) {
    throw OutputError(target_.string() + ": cannot be written: nothing was");
  }
  if (!file_.is_still_at(temporary_)) file_.reset(::open(temporary_.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
  if (!synced(file_) || ::rename(temporary_.c_str(), target_.c_str()) != 0) throw cannot_be_written(target_);
  is_committed_ = true;
  sync_folder(folder_of(target_));
}

void write_atomically(const fs::path& target, const std::function<void(const fs::path&)>& write) {
  NewFile file(target);
  write(file.temporary());
  file.commit();
}

bool is_temporary(const fs::path& file) {
  const std::string name = file.filename().string();
  return name.starts_with('.') && name.find(kMark) != std::string::npos;
}

namespace {

/// Of a lock that names its holder, who may be gone. Who is about to take one has not written its name yet.
bool is_taken_lock(const fs::path& file) {
  std::error_code failure;
  return file.filename() == FolderLock::kFile && fs::file_size(file, failure) > 0 && !failure;
}

}  // namespace

void remove_leftovers(const fs::path& folder, int depth) {
  std::error_code failure;
  for (fs::directory_iterator entry(folder, failure), end; !failure && entry != end; entry.increment(failure)) {
    const fs::path& path = entry->path();
    if (depth > 0 && entry->is_directory(failure) && !entry->is_symlink(failure)) remove_leftovers(path, depth - 1);
    if (!is_temporary(path) && !is_taken_lock(path)) continue;
    const FileDescriptor file(::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
    if (file.lock(LOCK_EX | LOCK_NB) && file.is_still_at(path)) ::unlink(path.c_str());
  }
}

std::vector<fs::path> files_in(const fs::path& folder, const std::function<bool(const fs::path&)>& is_wanted) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.is_regular_file() && is_wanted(entry.path())) files.push_back(entry.path());
  }
  std::ranges::sort(files);
  return files;
}

bool make_folders(const fs::path& folder) {
  std::error_code failure;
  if (fs::is_directory(folder, failure)) return false;
  const fs::path above = folder_of(folder);
  if (above != folder) make_folders(above);
  fs::create_directory(folder, failure);
  if (failure) throw OutputError(folder.string() + ": cannot make the folder: " + failure.message());
  sync_folder(above);
  return true;
}

void remove_output(const fs::path& path) {
  std::error_code failure;
  fs::remove_all(path, failure);
  if (failure) throw OutputError(path.string() + ": cannot be removed: " + failure.message());
}

void write_file(const fs::path& target, std::span<const std::byte> content) {
  write_atomically(target, [&](const fs::path& temporary) {
    errno = 0;
    std::ofstream out(temporary, std::ios::binary);
    out.write(reinterpret_cast<const char*>(content.data()), std::streamsize(content.size()));
    out.flush();
    if (!out) throw OutputError(target.string() + ": cannot be written: " + std::strerror(errno));
  });
}

void write_file(const fs::path& target, std::string_view content) {
  write_file(target, std::as_bytes(std::span(content.data(), content.size())));
}

std::vector<std::byte> read_binary_file(const fs::path& file) {
  std::ifstream in = opened(file);
  in.seekg(0, std::ios::end);
  std::vector<std::byte> content(std::size_t(in.tellg()));
  in.seekg(0);
  in.read(reinterpret_cast<char*>(content.data()), std::streamsize(content.size()));
  if (!in) throw InputError(file.string() + ": cannot be read to its end");
  return content;
}

std::string read_text_file(const fs::path& file) {
  return text_of(read_binary_file(file));
}

std::string sha256(std::span<const std::byte> content) {
  Sha256 digest;
  digest.add(content);
  return digest.hex();
}

std::string sha256_of_file(const fs::path& file) {
  std::ifstream in = opened(file);
  Sha256 digest;
  std::vector<std::byte> piece(std::size_t(1) << 20);
  while (in.read(reinterpret_cast<char*>(piece.data()), std::streamsize(piece.size())), in.gcount() > 0) {
    digest.add(std::span(piece).first(std::size_t(in.gcount())));
  }
  if (in.bad()) throw InputError(file.string() + ": cannot be read to its end");
  return digest.hex();
}

}  // namespace cnerf
