#include "tests/faults/commands.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "tests/support/tiny_options.h"

namespace cnerf::faults {
namespace fs = std::filesystem;
namespace {
using Words = std::vector<std::string>;

Words joined(Words a, const Words& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

/// One thread, so that operations come in the same order.
const Words kOneThread = {"--threads", "1"};
constexpr const char* kColorizer = "reference:references";

Words tiny() {
  return joined(
      test::tiny_options({"stage1.steps=30", "stage1.samples_per_step=2048", "stage1.checkpoint_every=10",
                          "stage1.grid.log2_rows=10", "stage2.grid.log2_rows=10", "colorizer.reference_steps=2"}),
      kOneThread);
}

/// A page that shows the take.
Words page() {
  return {"bake", "@/run", "--take", "t", "--threads", "1", "--format", "web", "--web-resolution", "24"};
}

/// w x y z of a rotation; good for half turns too.
std::array<double, 4> quaternion_of(const std::array<std::array<double, 3>, 3>& m) {
  const auto part = [](double square) { return std::sqrt(std::max(square, 0.0)) / 2; };
  return {part(1 + m[0][0] + m[1][1] + m[2][2]),
          std::copysign(part(1 + m[0][0] - m[1][1] - m[2][2]), m[2][1] - m[1][2]),
          std::copysign(part(1 - m[0][0] + m[1][1] - m[2][2]), m[0][2] - m[2][0]),
          std::copysign(part(1 - m[0][0] - m[1][1] + m[2][2]), m[1][0] - m[0][1])};
}

/// A capture's photographs alone, and its poses as a model of COLMAP: what `cnerf prepare` begins with.
void make_photographs(const fs::path& capture, const fs::path& photographs, const fs::path& model) {
  fs::create_directories(photographs);
  fs::create_directories(model);
  std::ifstream in(capture / "transforms.json");
  const auto transforms = nlohmann::json::parse(in);
  std::ofstream images(model / "images.txt");
  images.precision(17);
  int number = 0;
  for (const auto& frame : transforms.at("frames")) {
    const fs::path picture = capture / frame.at("file_path").get<std::string>();
    fs::copy_file(picture, photographs / picture.filename());
    const auto& pose = frame.at("transform_matrix");  // world from camera, which looks along -z
    std::array<std::array<double, 3>, 3> rotation{};  // camera from world, which looks along +z
    std::array<double, 3> translation{};
    for (std::size_t row = 0; row < 3; ++row) {
      const double sign = row == 0 ? 1 : -1;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        rotation[row][axis] = sign * pose[axis][row].get<double>();
        translation[row] -= rotation[row][axis] * pose[axis][3].get<double>();
      }
    }
    images << ++number;
    for (const double q : quaternion_of(rotation)) images << ' ' << q;
    for (const double t : translation) images << ' ' << t;
    images << " 1 " << picture.filename().string() << "\n\n";
  }
  const auto value = [&](const char* key, double otherwise) { return transforms.value(key, otherwise); };
  const double width = value("w", 48), height = value("h", 36);
  std::ofstream(model / "cameras.txt") << "1 PINHOLE " << width << ' ' << height << ' ' << value("fl_x", 50) << ' '
                                       << value("fl_y", value("fl_x", 50)) << ' ' << value("cx", width / 2) << ' '
                                       << value("cy", height / 2) << '\n';
  std::ofstream(model / "points3D.txt") << "1 0 0 0 9 9 9 0.1\n2 0.1 0 0.2 9 9 9 0.1\n";
}

}  // namespace

Fixtures::Fixtures(const Subject& subject, const fs::path& scratch) : folder_(fs::absolute(scratch) / "fixtures") {
  if (fs::exists(folder_ / "shown")) return;
  fs::remove_all(folder_);
  const Slot slot(scratch, 9);
  const auto make = [&](const Words& words) {
    const Ending ending = slot.run(subject, words);
    if (ending.code != 0) throw std::runtime_error("fixtures: " + words.front() + ": " + ending.said);
  };
  make({"sample", "-o", "@/capture", "--views", "6", "--width", "48", "--height", "36", "--samples-per-pixel", "1"});
  fs::create_directories(folder_);
  const auto move = [&](const char* name) {
    fs::copy(slot.root() / name, folder_ / name, fs::copy_options::recursive);
  };
  move("capture");
  make_photographs(folder_ / "capture", folder_ / "photographs", folder_ / "model");
  make(joined({"train", (folder_ / "capture").string(), "-o", "@/run"}, tiny()));
  move("run");
  make(joined({"colorize", "@/run", "--take", "t", "--colorizer", kColorizer}, kOneThread));
  fs::copy(slot.root() / "run", folder_ / "take", fs::copy_options::recursive);
  make({"bake", "@/run", "--take", "t", "-o", "@/bake"});
  move("bake");
  make(page());
  fs::copy(slot.root() / "run", folder_ / "shown", fs::copy_options::recursive);
}

std::vector<Command> Fixtures::commands() const {
  const std::string capture = (folder_ / "capture").string();
  const auto bake = [](const char* format) {
    return Words{"bake", "@/run", "--take", "t", "--format", format, "-o", "@/bake", "--threads", "1"};
  };
  // A field of 30 steps is thin; small textures make a trial a matter of seconds.
  const Words mesh = {"--set", "mesh.surface_depth=64", "--set", "mesh.faces=500", "--set", "mesh.texture_size=256"};
  return {
      {"sample",
       "",
       {"sample", "-o", "@/capture", "--views", "3", "--width", "24", "--height", "18", "--samples-per-pixel", "1",
        "--threads", "1"},
       {"capture"}},
      {"prepare",
       "",
       {"prepare", (folder_ / "photographs").string(), "-o", "@/capture", "--colmap-model",
        (folder_ / "model").string(), "--threads", "1"},
       {"capture"}},
      {"train", "", joined({"train", capture, "-o", "@/run"}, tiny()), {"run"}},
      // Photographs that are too much for the memory they may take lie in a file of no name.
      {"train-in-file", "", joined({"train", capture, "-o", "@/run", "--image-memory", "4k"}, tiny()), {"run"}},
      {"colorize", "run", joined({"colorize", "@/run", "--take", "t", "--colorizer", kColorizer}, kOneThread), {"run"}},
      {"bake", "take", joined(bake("vdb"), {"--nvdb"}), {"run", "bake/volume.vdb"}},
      {"web", "take", joined(bake("web"), {"--web-resolution", "24"}), {"run"}},
      {"gltf", "take", joined(bake("gltf"), mesh), {"run"}},
      {"exr", "take", joined(bake("exr"), mesh), {"run"}},
      {"eval", "take", joined({"eval", "@/run", "--take", "t"}, kOneThread), {"run"}},
      {"render", "take", joined({"render", "@/run", "--take", "t", "--format", "png,exr,mp4"}, kOneThread), {"run"}},
      {"run",
       "",
       joined({"run", capture, "-o", "@/run", "--colorizer", kColorizer, "--format", "vdb"}, tiny()),
       {"run"}},
      {"compare", "", joined({"compare", capture, "-o", "@/out", "--methods", "colornerf,grey"}, tiny()), {}},
  };
}

std::vector<Command> Fixtures::commands(const std::vector<std::string>& names) const {
  std::vector<Command> all = commands(), chosen;
  if (names.empty()) return all;
  for (const std::string& name : names) {
    const auto found = std::ranges::find(all, name, &Command::name);
    if (found == all.end()) throw std::runtime_error("no such command: " + name);
    chosen.push_back(*found);
  }
  return chosen;
}

std::vector<Command> Fixtures::neighbours() const {
  const std::string capture = (folder_ / "capture").string();
  const auto command = [](const char* name, const Words& words) { return Command{name, "shown", words, {}}; };
  return {
      command("train", joined({"train", capture, "-o", "@/run", "--overwrite"}, tiny())),
      command("colorize", joined({"colorize", "@/run", "--take", "u", "--colorizer", kColorizer}, kOneThread)),
      command("colorize-other", joined({"colorize", "@/run", "--take", "v", "--colorizer", "grey"}, kOneThread)),
      command("bake", {"bake", "@/run", "--take", "t", "--threads", "1"}),
      command("bake-smaller", {"bake", "@/run", "--take", "t", "--threads", "1", "--resolution", "24"}),
      command("web", joined(page(), {"--overwrite"})),
      command("eval", joined({"eval", "@/run", "--take", "t"}, kOneThread)),
      command("render", joined({"render", "@/run", "--take", "t"}, kOneThread)),
      command("info", {"info", "@/run"}),
      command("view", {"view", "@/run", "--no-browser", "--port", "0"}),
  };
}

std::vector<Command> Fixtures::readers() const {
  const auto reader = [&](const char* name, const fs::path& what) {
    return Command{name, "", {"info", (folder_ / what).string()}, {}};
  };
  return {reader("info capture", "capture"), reader("info run", "take"),
          reader("info stage1.snapshot", "take/stage1.snapshot"),
          reader("info take.snapshot", "take/takes/t/take.snapshot"), reader("info volume.vdb", "bake/volume.vdb")};
}

void Fixtures::lay_out(const Slot& slot, const Command& command) const {
  slot.clear();
  if (!command.fixture.empty()) fs::copy(folder_ / command.fixture, slot.root() / "run", fs::copy_options::recursive);
}

}  // namespace cnerf::faults
