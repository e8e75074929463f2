#include "src/pipeline/picture_files.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfInputFile.h>
#include <ImfStandardAttributes.h>
#include <gtest/gtest.h>

#include <opencv2/videoio.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/pipeline/render_step.h"
#include "tests/evaluate/painted_scene.h"
#include "tests/support/data.h"

namespace cnerf::pipeline {
namespace {
namespace fs = std::filesystem;

RenderedImage small_image() {
  RenderedImage image{2, 1, {0.25f, 0.5f}, {1.0f, 0.5f}, {3.5f, 0.0f}, {}, {}};
  image.rgb = {0.1f, 0.2f, 0.3f, 1e6f, 0, 0};
  return image;
}

std::vector<float> channel_of(const fs::path& file, const char* name) {
  Imf::InputFile in(file.c_str());
  std::vector<float> values(2);
  Imf::FrameBuffer frame;
  frame.insert(name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(values.data()), sizeof(float), 2 * sizeof(float)));
  in.setFrameBuffer(frame);
  in.readPixels(0);
  return values;
}

TEST(PictureFiles, ExrHoldsColourCoverageAndDepth) {
  const test::TempDir folder;
  const fs::path file = folder / "a.exr";
  write_exr(file, small_image(), ShownColor::kDecoded);
  EXPECT_NEAR(channel_of(file, "R")[0], 0.1f, 1e-4);
  EXPECT_NEAR(channel_of(file, "B")[0], 0.3f, 2e-4) << "half precision";
  EXPECT_EQ(channel_of(file, "R")[1], 65504) << "more than a half holds is clamped, not infinite";
  EXPECT_EQ(channel_of(file, "A"), (std::vector<float>{1.0f, 0.5f}));
  EXPECT_EQ(channel_of(file, "Z"), (std::vector<float>{3.5f, 0.0f}));
  const Imf::Header header = Imf::InputFile(file.c_str()).header();
  ASSERT_TRUE(Imf::hasChromaticities(header));
  EXPECT_NEAR(Imf::chromaticities(header).red.x, 0.64, 1e-6);
  EXPECT_EQ(header.channels()["R"].type, Imf::HALF);
  EXPECT_EQ(header.channels()["Z"].type, Imf::FLOAT);
}

TEST(PictureFiles, AnUncolouredViewIsShownGrey) {
  RenderedImage image = small_image();
  image.rgb.clear();
  EXPECT_EQ(shown_rgb(image, ShownColor::kDecoded), (std::vector<float>{0.25f, 0.25f, 0.25f, 0.5f, 0.5f, 0.5f}));
  image.baked_rgb = {1, 2, 3, 4, 5, 6};
  EXPECT_EQ(shown_rgb(image, ShownColor::kBaked), image.baked_rgb);
}

TEST(PictureFiles, AnUnwritableExrIsAnOutputError) {
  const test::TempDir folder;
  write_file(folder / "file", std::string_view("x"));
  EXPECT_THROW(write_exr(folder / "file" / "a.exr", small_image(), ShownColor::kDecoded), OutputError);
}

/// Frames of such widths, of a scene that nobody trained, below out/path.
void render_frames(const fs::path& folder, const std::vector<int>& widths, const RenderOutput& output) {
  const RunContext context{RunDirectory(folder / "run"), {}, {}, {}};
  context.directory.save(RunRecord{});
  CameraPath path{"path", {}};
  for (const int width : widths) {
    PathCamera camera{"frame_" + std::to_string(path.cameras.size()), {}, {}};
    camera.intrinsics.width = width;
    camera.intrinsics.height = 8;
    path.cameras.push_back(camera);
  }
  const test::PaintedScene scene(0.5f, false);
  Observer silent;
  render_step(context, {"", path, output, &scene}, cpu_engines(), silent);
}

TEST(PictureFiles, OfAFormerRenderGoWhereItIsOverwritten) {
  const test::TempDir folder;
  const fs::path out = folder / "out", frames = out / "path";
  render_frames(folder.path(), {8, 8, 8}, {.folder = out, .png = true, .exr = true});
  for (const char* others : {"notes.txt", "mine_3.png", "below/frame_2.png"}) write_file(frames / others, "a person's");
  render_frames(folder.path(), {8}, {.folder = out, .png = true});
  EXPECT_TRUE(fs::exists(frames / "frame_2.png")) << "not asked for";
  render_frames(folder.path(), {8}, {.folder = out, .png = true, .overwrite = true});
  for (const char* gone : {"frame_1.png", "frame_2.png"}) EXPECT_FALSE(fs::exists(frames / gone)) << gone;
  for (const char* left : {"frame_0.png", "frame_2.exr", "notes.txt", "mine_3.png", "below/frame_2.png"}) {
    EXPECT_TRUE(fs::exists(frames / left)) << left;
  }
}

TEST(PictureFiles, AVideoOfSeveralSizesIsRefusedBeforeItIsRendered) {
  const test::TempDir folder;
  const RenderOutput both{.folder = folder / "out", .png = true, .mp4 = true};
  EXPECT_THROW(render_frames(folder.path(), {8, 8, 6}, both), UsageError);
  EXPECT_FALSE(fs::exists(folder / "out"));
  render_frames(folder.path(), {8, 6}, {.folder = folder / "out", .png = true});
  EXPECT_TRUE(fs::exists(folder / "out/path/frame_1.png")) << "pictures may have several";
}

TEST(PictureFiles, AVideoAppearsWhenItIsWholeAndHoldsEveryPicture) {
  const test::TempDir folder;
  const Picture picture{64, 48, std::vector<std::uint8_t>(std::size_t(64) * 48 * 3, 128)};
  {
    VideoFile dropped(folder / "dropped.mp4", 10);
    if (!dropped.add(picture)) GTEST_SKIP() << "this OpenCV has no MPEG-4 encoder";
  }
  EXPECT_TRUE(fs::is_empty(folder.path())) << "a video that was not finished leaves nothing";
  VideoFile video(folder / "a.mp4", 10);
  for (int i = 0; i < 7; ++i) ASSERT_TRUE(video.add(picture));
  EXPECT_FALSE(fs::exists(folder / "a.mp4"));
  video.finish();
  cv::VideoCapture read((folder / "a.mp4").string());
  EXPECT_EQ(read.get(cv::CAP_PROP_FRAME_COUNT), 7);
  EXPECT_EQ(read.get(cv::CAP_PROP_FRAME_WIDTH), 64);
}

}  // namespace
}  // namespace cnerf::pipeline
