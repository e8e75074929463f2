#include "tests/blender/blender_run.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <sys/wait.h>

#include <array>
#include <cstdlib>
#include <sstream>
#include <stdexcept>

#include "src/base/files.h"

namespace cnerf::test {
namespace fs = std::filesystem;

std::optional<fs::path> find_blender() {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path != nullptr ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (fs::exists(fs::path(folder) / "blender")) return fs::path(folder) / "blender";
  }
  return std::nullopt;
}

int run_blender(const fs::path& setup, const std::string& arguments, const fs::path& after) {
  std::string command = "'" + find_blender()->string() + "' -b --python-exit-code 1 --python '" + setup.string() + "'";
  if (!after.empty()) command += " --python '" + after.string() + "'";
  command += " -- " + arguments + " > '" + (setup.parent_path() / "blender.log").string() + "' 2>&1";
  const int status = std::system(command.c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

RenderedExr render_exact(const fs::path& setup, const std::string& arguments) {
  const fs::path picture = setup.parent_path() / "render.exr";
  fs::remove(picture);
  const int status = run_blender(setup, "--exact --render '" + picture.string() + "' " + arguments);
  if (status != 0 || !fs::exists(picture)) {
    throw std::runtime_error("blender failed:\n" + read_text_file(setup.parent_path() / "blender.log"));
  }
  return read_exr(picture);
}

RenderedExr read_exr(const fs::path& file) {
  Imf::InputFile input(file.c_str());
  const Imath::Box2i window = input.header().dataWindow();
  RenderedExr image;
  image.width = window.max.x - window.min.x + 1;
  image.height = window.max.y - window.min.y + 1;
  image.rgba.resize(4 * std::size_t(image.width) * image.height);
  Imf::FrameBuffer frame;
  const std::array<const char*, 4> names{"R", "G", "B", "A"};
  for (std::size_t c = 0; c < names.size(); ++c) {
    const bool is_missing = input.header().channels().findChannel(names[c]) == nullptr;
    if (is_missing && names[c] != std::string("A")) {
      throw std::runtime_error(file.string() + ": no channel " + names[c]);
    }
    if (is_missing) {
      for (std::size_t p = c; p < image.rgba.size(); p += names.size()) image.rgba[p] = 1;
      continue;
    }
    frame.insert(names[c], Imf::Slice::Make(Imf::FLOAT, image.rgba.data() + c, window, 4 * sizeof(float),
                                            4 * sizeof(float) * std::size_t(image.width)));
  }
  input.setFrameBuffer(frame);
  input.readPixels(window.min.y, window.max.y);
  return image;
}

}  // namespace cnerf::test
