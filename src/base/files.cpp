#include "src/base/files.h"

#include <openssl/evp.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <memory>
#include <system_error>

#include "src/base/error.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

std::ifstream opened(const fs::path& file) {
  std::error_code failure;
  if (!fs::exists(file, failure)) throw MissingInputError(file.string() + ": no such file");
  if (fs::is_directory(file, failure)) throw InputError(file.string() + ": is a folder, expected a file");
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

}  // namespace

void write_atomically(const fs::path& target, const std::function<void(const fs::path&)>& write) {
  std::error_code failure;
  if (target.has_parent_path()) fs::create_directories(target.parent_path(), failure);
  if (failure) throw OutputError(target.parent_path().string() + ": cannot make the folder: " + failure.message());

  const fs::path temporary = target.parent_path() / ("." + target.stem().string() + ".partial-" +
                                                     std::to_string(::getpid()) + target.extension().string());
  try {
    write(temporary);
  } catch (...) {
    fs::remove(temporary, failure);
    throw;
  }
  fs::rename(temporary, target, failure);
  if (failure) {
    const std::string reason = failure.message();
    fs::remove(temporary, failure);
    throw OutputError(target.string() + ": cannot be written: " + reason);
  }
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
  const std::vector<std::byte> content = read_binary_file(file);
  return {reinterpret_cast<const char*>(content.data()), content.size()};
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
