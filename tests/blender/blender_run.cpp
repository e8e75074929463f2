#include "tests/blender/blender_run.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <fmt/format.h>
#include <sys/wait.h>

#include <array>
#include <cstdlib>
#include <sstream>
#include <stdexcept>

#include "src/base/files.h"

namespace cnerf::test {
namespace fs = std::filesystem;

namespace {

RenderedExr render(const fs::path& setup, const std::string& arguments, const fs::path& after = {}) {
  const fs::path picture = setup.parent_path() / "render.exr";
  fs::remove(picture);
  const int status = run_blender(setup, "--render '" + picture.string() + "' " + arguments, after);
  if (status != 0 || !fs::exists(picture)) {
    throw std::runtime_error("blender failed:\n" + read_text_file(setup.parent_path() / "blender.log"));
  }
  return read_exr(picture);
}

}  // namespace

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
  return render(setup, "--exact " + arguments);
}

std::vector<RenderedExr> render_each_exact(const fs::path& setup, const std::vector<std::string>& arguments) {
  const fs::path folder = setup.parent_path(), script = folder / "variants.py";
  const auto picture_of = [&](std::size_t variant) { return folder / fmt::format("variant{}.exr", variant); };
  // As the main program, which it must be to begin with Blender's factory settings: nothing is left of a scene before.
  std::string text = "import runpy, shlex, sys\nfor arguments in [\n";
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    fs::remove(picture_of(i));
    text += fmt::format("    r\"\"\"--render '{}' --exact {}\"\"\",\n", picture_of(i).string(), arguments[i]);
  }
  text += "]:\n    sys.argv = ['blender', '--'] + shlex.split(arguments)\n    runpy.run_path(r'" + setup.string() +
          "', run_name='__main__')\n";
  write_file(script, text);
  const int status = run_blender(script, "");
  std::vector<RenderedExr> pictures;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    if (status != 0 || !fs::exists(picture_of(i))) {
      throw std::runtime_error("blender failed:\n" + read_text_file(folder / "blender.log"));
    }
    pictures.push_back(read_exr(picture_of(i)));
  }
  return pictures;
}

std::vector<RenderedExr> render_cameras(const fs::path& setup, const std::string& arguments,
                                        const std::vector<std::string>& cameras) {
  const fs::path folder = setup.parent_path(), script = folder / "cameras.py";
  const auto picture_of = [&](std::size_t camera) { return (folder / fmt::format("{}.exr", camera)).string(); };
  std::string rest = "import bpy\nscene = bpy.context.scene\n";  // the first picture has set up how they are written
  for (std::size_t i = 1; i < cameras.size(); ++i) {
    rest += fmt::format("scene.camera = bpy.data.objects['{}']\nscene.render.filepath = r'{}'\n", cameras[i],
                        picture_of(i)) +
            "bpy.ops.render.render(write_still=True)\n";
  }
  write_file(script, rest);
  std::vector<RenderedExr> pictures = {render(setup, "--camera " + cameras.front() + " " + arguments, script)};
  for (std::size_t i = 1; i < cameras.size(); ++i) pictures.push_back(read_exr(picture_of(i)));
  return pictures;
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
