#include "export/texture_writer.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfInputFile.h>
#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>
#include <gtest/gtest.h>

#include "bake/provenance.h"
#include "tests/export/test_meshes.h"
#include "tests/support/data.h"

namespace cnerf::exporting::test {
using namespace cnerf::test;
namespace {
namespace fs = std::filesystem;

std::vector<float> read_channel(const fs::path& file, const std::string& channel) {
  Imf::InputFile input(file.c_str());
  EXPECT_NE(input.header().channels().findChannel(channel), nullptr) << channel;
  const Imath::Box2i window = input.header().dataWindow();
  const auto width = std::size_t(window.max.x + 1);
  std::vector<float> values(width * std::size_t(window.max.y + 1));
  Imf::FrameBuffer frame;
  frame.insert(channel,
               Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(values.data()), sizeof(float), sizeof(float) * width));
  input.setFrameBuffer(frame);
  input.readPixels(0, window.max.y);
  return values;
}

std::string text_attribute(const Imf::Header& header, const char* name) {
  const auto* attribute = header.findTypedAttribute<Imf::StringAttribute>(name);
  return attribute != nullptr ? attribute->value() : "missing";
}

TEST(ExrTextures, HoldTheChannelsThatTheirNamesSay) {
  const TempDir folder;
  const bake::Texture texture = tetrahedron().texture;
  const TextureFiles files =
      write_exr_textures(texture, bake::color_origin_text("builtin", "first"), folder.path(), "mesh");
  EXPECT_EQ(files.rgb.filename(), "mesh_rgb.exr");
  EXPECT_EQ(files.luminance.filename(), "mesh_lum.exr");
  EXPECT_EQ(files.lab.filename(), "mesh_lab.exr");

  EXPECT_EQ(read_channel(files.luminance, "Y"), texture.luminance) << "exact";
  EXPECT_EQ(read_channel(files.lab, "Lab.a"), texture.a) << "exact: data is never lossy";
  EXPECT_EQ(read_channel(files.lab, "Lab.b"), texture.b);
  const std::vector<float> lightness = read_channel(files.lab, "Lab.L"), green = read_channel(files.rgb, "G");
  for (std::size_t i = 0; i < green.size(); ++i) {
    ASSERT_NEAR(green[i], texture.rgb[i].y, 1e-3 * texture.rgb[i].y + 1e-7) << "half";
    ASSERT_FLOAT_EQ(lightness[i], lightness_from_luminance(texture.luminance[i]));
    const bool is_grey = i / 64 % 2 == 0;
    ASSERT_TRUE(!is_grey || (texture.a[i] == 0 && texture.b[i] == 0));
  }
}

TEST(ExrTextures, SayWhatTheyAre) {
  const TempDir folder;
  const TextureFiles files =
      write_exr_textures(tetrahedron().texture, bake::color_origin_text("builtin", "first"), folder.path(), "mesh");
  for (const fs::path& file : {files.rgb, files.luminance, files.lab}) {
    const Imf::InputFile input(file.c_str());
    const Imf::Header& header = input.header();
    ASSERT_TRUE(Imf::hasChromaticities(header)) << file;
    EXPECT_EQ(Imf::chromaticities(header).red, Imath::V2f(0.64f, 0.33f));
    EXPECT_EQ(Imf::chromaticities(header).white, Imath::V2f(0.3127f, 0.3290f));
    EXPECT_EQ(header.compression(), Imf::ZIP_COMPRESSION);
    EXPECT_EQ(text_attribute(header, "colorOrigin"), "colour is inferred, by colorizer builtin, take first");
    EXPECT_NE(text_attribute(header, "colorSpace"), "missing");
  }
}

}  // namespace
}  // namespace cnerf::exporting::test
