#pragma once
/// Names of files for what is made of views, by the names of these.

#include <algorithm>
#include <set>
#include <string>

#include "src/capture/listing.h"

namespace cnerf {

/// "shot.0001.jpg" is shot.0001, and so is "shot.0001".
[[nodiscard]] inline std::string without_image_extension(const std::string& name) {
  const std::filesystem::path file(name);
  return is_image_file(file) ? std::filesystem::path(file).replace_extension().string() : name;
}

/// Each is given once, without folders and the extension of an image.
class PictureNames {
 public:
  [[nodiscard]] std::string name_for(const std::string& view) {
    std::string name = without_image_extension(view);
    std::ranges::replace_if(
        name, [](char c) { return c == '/' || c == '\\'; }, '_');
    constexpr std::size_t kMostBytes = 150;  // of a view's path; file systems take 255, with all that is added
    if (name.size() > kMostBytes) {
      name.erase(0, name.size() - kMostBytes);
      name.erase(name.begin(), std::ranges::find_if_not(name, is_inside_letter));
    }
    while (!taken_.insert(name).second) name += "_";
    return name;
  }

 private:
  /// Of UTF-8.
  static bool is_inside_letter(char byte) { return (static_cast<unsigned char>(byte) & 0xC0) == 0x80; }

  std::set<std::string> taken_;
};

}  // namespace cnerf
