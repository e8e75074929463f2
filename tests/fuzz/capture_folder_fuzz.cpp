/// A capture's folder by its conventions: pieces of "name of a file", a line's end, and its content. A content of
/// "picture" is a small one.

#include <algorithm>
#include <array>
#include <cctype>

#include "src/capture/load_capture.h"
#include "tests/fuzz/fuzz_target.h"

namespace {
namespace fs = std::filesystem;
using cnerf::fuzz::Bytes;

/// A grey image of 2x2 pixels.
constexpr std::array<unsigned char, 71> kPicture = {
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52, 0x00, 0x00,
    0x00, 0x02, 0x00, 0x00, 0x00, 0x02, 0x08, 0x00, 0x00, 0x00, 0x00, 0x57, 0xdd, 0x52, 0xf8, 0x00, 0x00, 0x00,
    0x0e, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9c, 0x63, 0x70, 0x68, 0x60, 0x38, 0xf0, 0x1f, 0x00, 0x05, 0xc5, 0x02,
    0x80, 0x58, 0x96, 0x3a, 0xcb, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};

/// A path below the folder, of plain letters; empty where the input has another one.
std::string plain_path(const std::string& name) {
  const auto is_plain = [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '_' || c == '.' || c == '/' || c == '-';
  };
  const bool is_usable = !name.empty() && name.size() < 60 && std::ranges::all_of(name, is_plain) &&
                         std::ranges::count(name, '/') < 5 && name.find("..") == name.npos && name.front() != '/' &&
                         name.back() != '/';
  return is_usable ? name : "";
}

}  // namespace

CNERF_FUZZ_TARGET(capture_folder) {
  using namespace cnerf;
  const fs::path folder = fuzz::scratch_folder() / "capture";
  std::error_code failure;
  fs::remove_all(folder, failure);
  fs::create_directories(folder);
  for (const Bytes piece : fuzz::pieces_of(input, 12)) {
    const std::string text = fuzz::text_of(piece);
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string name = plain_path(text.substr(0, end));
    if (name.empty() || fs::exists(folder / name, failure)) continue;
    const Bytes content = piece.subspan(std::min(end + 1, piece.size()));
    const bool is_picture = fuzz::text_of(content) == "picture";
    try {
      (void)fuzz::scratch_file("capture/" + name, is_picture ? std::as_bytes(std::span(kPicture)) : content);
    } catch (const std::runtime_error&) {  // a file where it wants a folder
    }
  }
  fuzz::read_or_refuse(folder, [&] { return survey_capture(folder); });
  fuzz::read_or_refuse(folder, [&] { return load_capture(folder); });
}
