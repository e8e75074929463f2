/// Whole runs on a tiny capture.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "src/base/files.h"
#include "tests/e2e/program.h"
#include "tests/support/data.h"
#include "tests/support/exif_jpeg.h"
#include "tests/support/json_file.h"

namespace cnerf::test {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;

ProgramResult train(const fs::path& capture, const fs::path& out, const std::vector<std::string>& more = {}) {
  return cnerf(concatenated(concatenated({"train", capture.string(), "-o", out.string()}, tiny_options()), more));
}

TEST(Pipeline, RunLeavesEverythingItSays) {
  const TempDir folder;
  const fs::path out = folder / "run";
  const auto arguments = concatenated({"run", tiny_capture().string(), "-o", out.string()}, tiny_options());
  const ProgramResult result = cnerf(arguments);
  ASSERT_EQ(result.exit_code, 0) << result.err << result.out;
  EXPECT_THAT(result.out, HasSubstr("references")) << "says whose colours were taken";

  const std::vector<std::string> files = files_below(out);
  for (const char* file :
       {"config.toml", "run.json", "stage1.snapshot", "takes/reference/take.snapshot", "takes/reference/take.json",
        "takes/reference/metrics.json", "metrics.json", "contact_sheet.png", "bakes/reference/volume.vdb",
        "bakes/reference/blender_setup.py", "bakes/reference/manifest.json"}) {
    EXPECT_THAT(files, testing::Contains(file));
  }
  for (const std::string& file : files) EXPECT_THAT(file, testing::Not(HasSubstr("partial")));
  for (const char* file : {"contact_sheet.png", "metrics.json", "volume.vdb", "blender_setup.py"}) {
    EXPECT_THAT(result.out, HasSubstr(file)) << "is printed";
  }

  const nlohmann::json metrics = json_of(out / "metrics.json");
  EXPECT_EQ(metrics.at("schema_version"), 1);
  EXPECT_EQ(metrics.at("split"), "held-out");
  EXPECT_EQ(metrics.at("take"), "reference");
  for (const char* name :
       {"psnr_luminance", "psnr_rgb", "ssim", "colourfulness", "colourfulness_difference", "colour_diversity",
        "colour_diversity_truth", "ab_error", "ab_error_grey", "bake_ab_distance"}) {
    EXPECT_TRUE(metrics.at("mean").contains(name)) << name;
  }
  EXPECT_EQ(metrics.at("views").size(), 2u) << "every 8th of 9 views";

  EXPECT_EQ(cnerf(arguments).exit_code, 64) << "a finished run is not overwritten";
  const ProgramResult again = cnerf(concatenated(arguments, {"--resume"}));
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(files_below(out), files) << "nothing is left to do";
  const ProgramResult mesh = cnerf(concatenated(arguments, {"--resume", "--format", "gltf"}));
  EXPECT_EQ(mesh.exit_code, 0) << mesh.err;
  EXPECT_THAT(files_below(out), testing::IsSupersetOf({"bakes/reference/mesh.gltf", "bakes/reference/volume.vdb"}))
      << "what is asked for comes to what is there";

  for (const fs::path& thing : {out, out / "stage1.snapshot", out / "bakes/reference/volume.vdb"}) {
    const ProgramResult info = cnerf({"info", thing.string()});
    EXPECT_EQ(info.exit_code, 0) << thing << info.err;
    EXPECT_GT(info.out.size(), 50u);
  }
}

TEST(Pipeline, ARunThatIsColouredLaterIsEvaluatedAgain) {
  const TempDir folder;
  const fs::path out = copied(tiny_run(), folder / "run");
  const auto run = concatenated({"run", tiny_capture().string(), "-o", out.string(), "--resume"},
                                concatenated(tiny_options(), {"--set", "render.frames=2"}));
  ASSERT_EQ(cnerf(concatenated(run, {"--grey"})).exit_code, 0);
  EXPECT_EQ(json_of(out / "metrics.json").at("take"), "");
  const ProgramResult colored = cnerf(concatenated(run, {"--colorizer", "reference:references"}));
  ASSERT_EQ(colored.exit_code, 0) << colored.err;
  EXPECT_EQ(json_of(out / "metrics.json").at("take"), "reference");
  EXPECT_TRUE(fs::exists(out / "takes/reference/metrics.json"));
}

TEST(Pipeline, AJournalIsReplayedIntoATakeOfItsOwn) {
  const TempDir folder;
  const fs::path run = copied(tiny_run(), folder / "run");
  for (const char* take : {"first", "painted"}) {
    const ProgramResult made = cnerf(
        {"colorize", run.string(), "--colorizer", "grey", "--take", take, "--set", "stage2.working_resolution=40"});
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
  const nlohmann::json stroke = {{"id", "s"},       {"view", "images/view_004.png"},
                                 {"kind", "paint"}, {"color", "#c03020"},
                                 {"size", 0.2},     {"points", {{0.5, 0.5, 1.0}}}};
  nlohmann::json picture = stroke;
  picture.update({{"id", "p"}, {"kind", "picture"}, {"picture", "0123456789ab"}, {"points", nlohmann::json::array()}});
  fs::create_directories(run / "takes/painted/painted");
  fs::copy_file(tiny_capture() / "color/view_004.png", run / "takes/painted/painted/0123456789ab.png");
  const nlohmann::json journal = {{"deeds", {{{"base", "first"}}, {{"strokes", {stroke, picture}}, {"steps", 3}}}}};
  write_file(run / "takes/painted/journal.json", journal.dump());
  const auto replay = [&](const std::string& take) {
    return cnerf({"colorize", run.string(), "--replay", "painted", "--take", take, "--overwrite"});
  };
  for (const char* needed : {"first", "painted"}) {
    const ProgramResult refused = replay(needed);
    EXPECT_EQ(refused.exit_code, 64) << refused.err;
    EXPECT_TRUE(fs::exists(run / "takes" / needed / "take.snapshot"));
  }
  for (int again = 0; again < 2; ++again) {
    const ProgramResult replayed = replay("again");
    EXPECT_EQ(replayed.exit_code, 0) << replayed.err;
    EXPECT_TRUE(fs::exists(run / "takes/again/take.json"));
    EXPECT_TRUE(fs::exists(run / "takes/again/painted/0123456789ab.png")) << "its journal names it";
    EXPECT_THAT(read_text_file(run / "takes/again/config.toml"), testing::HasSubstr("working_resolution = 40"));
  }
}

TEST(Pipeline, StepsOneByOneWithoutColour) {
  const TempDir folder;
  const std::string out = copied(tiny_run(), folder / "run").string();
  EXPECT_EQ(cnerf({"eval", out}).exit_code, 0);
  const nlohmann::json plain = json_of(folder / "run/metrics.json");
  EXPECT_FALSE(plain.at("mean").contains("psnr_rgb"));
  EXPECT_FALSE(plain.at("mean").contains("psnr_luminance_aligned"));
  EXPECT_TRUE(plain.at("mean").contains("near_opacity"));
  EXPECT_LE(plain.at("spread").at("psnr_luminance").at("worst"), plain.at("mean").at("psnr_luminance"));
  EXPECT_EQ(cnerf({"eval", out, "--aligned"}).exit_code, 0);
  const nlohmann::json aligned = json_of(folder / "run/metrics.json");
  for (const nlohmann::json& view : aligned.at("views")) EXPECT_TRUE(view.contains("psnr_luminance_aligned"));
  EXPECT_EQ(aligned.at("mean").at("psnr_luminance"), plain.at("mean").at("psnr_luminance"));
  EXPECT_EQ(cnerf({"bake", out}).exit_code, 0);
  EXPECT_EQ(cnerf({"bake", out}).exit_code, 64) << "a bake is not overwritten";
  EXPECT_EQ(cnerf({"bake", out, "--overwrite", "--houdini"}).exit_code, 0);
  const ProgramResult render = cnerf({"render", out, "--path", "held-out", "--format", "png,exr"});
  EXPECT_EQ(render.exit_code, 0) << render.err;
  EXPECT_EQ(files_below(folder / "run/renders/grey/held-out").size(), 4u) << "two views, two formats";
  EXPECT_EQ(cnerf({"render", out, "--path", "held-out", "-o", out + "/"}).exit_code, 0) << "the run's own folder";
  const fs::path averaged = folder / "averaged";
  EXPECT_EQ(cnerf({"render", out, "--path", "held-out", "--view-averaged", "-o", averaged.string()}).exit_code, 0);
  const std::string picture = files_below(averaged / "held-out").at(0);
  EXPECT_NE(read_binary_file(averaged / "held-out" / picture),
            read_binary_file(folder / "run/renders/grey/held-out" / picture))
      << "luminance depends on the view, its mean does not";
  EXPECT_EQ(cnerf({"render", out, "--path", "orbit", "--format", "gif"}).exit_code, 64);
  EXPECT_EQ(cnerf({"eval", out, "--take", "none"}).exit_code, 66);
}

TEST(Pipeline, TakesStandSideBySide) {
  const TempDir folder;
  const std::string out = copied(tiny_run(), folder / "run").string();
  const auto colorize = [&](const std::vector<std::string>& more) {
    return cnerf(concatenated({"colorize", out, "--colorizer", "grey"}, more)).exit_code;
  };
  EXPECT_EQ(colorize({}), 0);
  EXPECT_EQ(colorize({}), 0) << "a second take gets a name of its own";
  EXPECT_EQ(colorize({"--take", "mine"}), 0);
  EXPECT_EQ(colorize({"--take", "mine"}), 64);
  EXPECT_EQ(colorize({"--take", "a/b"}), 64);
  for (const char* take : {"grey", "grey-2", "mine"}) {
    EXPECT_TRUE(fs::exists(folder / "run/takes" / take / "take.json")) << take;
  }
}

TEST(Pipeline, KeyViewsAreSuggestedWithoutColours) {
  const TempDir folder;
  const std::string out = copied(tiny_run(), folder / "run").string();
  const ProgramResult result = cnerf({"colorize", out, "--suggest-keyframes", "2"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json views = json_of(folder / "run/key_views.json");
  ASSERT_EQ(views.at("suggested").size(), 2u);
  EXPECT_EQ(views.at("alone").size(), 7u) << "views that are trained on";
  const std::string first = views.at("suggested")[0].at("view"), second = views.at("suggested")[1].at("view");
  EXPECT_NE(first, second);
  EXPECT_GE(views.at("suggested")[0].at("adds"), views.at("suggested")[1].at("adds"));
  EXPECT_THAT(result.out, HasSubstr(first));
  EXPECT_GT(cv::imread((folder / "run/key_views.png").string()).cols, 0);
  EXPECT_FALSE(fs::exists(folder / "run/takes")) << "nothing is coloured";
  EXPECT_EQ(cnerf({"colorize", out, "--suggest-keyframes", "0"}).exit_code, 64);
}

TEST(Pipeline, EvaluationMeasuresLpipsWithWeights) {
  CNERF_REQUIRE_DATA(weights, "lpips/lpips_alex_f32.bin");
  const TempDir folder;
  const std::string out = copied(tiny_take(), folder / "run").string();
  ASSERT_EQ(cnerf({"eval", out}).exit_code, 0);
  EXPECT_FALSE(json_of(folder / "run/metrics.json").at("mean").contains("lpips"));
  const ProgramResult result = cnerf({"eval", out, "--lpips-weights", weights.string()});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_GT(json_of(folder / "run/metrics.json").at("mean").at("lpips").get<double>(), 0);
  EXPECT_THAT(result.out + result.err, HasSubstr("LPIPS"));
  EXPECT_EQ(cnerf({"eval", out, "--lpips-weights", "missing.bin"}).exit_code, 66);
}

TEST(Pipeline, PhotographsInColour) {
  const TempDir folder;
  const std::string out = copied(tiny_take(), folder / "run").string();
  const auto render = [&](const std::vector<std::string>& more) {
    return cnerf(concatenated({"render", out, "--photographs"}, more));
  };
  const ProgramResult result = render({});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("renders/grey/photographs"));
  EXPECT_EQ(files_below(folder / "run/renders/grey/photographs").size(), 9u);
  const fs::path picture = folder / "run/renders/grey/photographs/view_000.png";
  EXPECT_EQ(cv::imread(picture.string(), cv::IMREAD_UNCHANGED).depth(), CV_16U);
  EXPECT_EQ(render({}).exit_code, 64) << "they are not overwritten";
  EXPECT_EQ(render({"--overwrite", "--views", "view_000"}).exit_code, 0);
  EXPECT_EQ(files_below(folder / "run/renders/grey/photographs").size(), 9u) << "the others stay";

  const std::string elsewhere = (folder / "elsewhere").string();
  EXPECT_EQ(render({"--format", "tiff", "--views", "view_001,view_004", "-o", elsewhere}).exit_code, 0);
  EXPECT_THAT(files_below(elsewhere), testing::ElementsAre("photographs/view_001.tiff", "photographs/view_004.tiff"));

  for (const std::vector<std::string>& wrong : std::vector<std::vector<std::string>>{
           {"--format", "exr"}, {"--path", "orbit"}, {"--baked"}, {"--views", "zebra"}, {"--format", "png,tiff"}}) {
    const ProgramResult refused = render(concatenated(wrong, {"-o", (folder / "other").string()}));
    EXPECT_EQ(refused.exit_code, 64) << refused.err;
    EXPECT_THAT(refused.err, HasSubstr(wrong.back()));
  }
  EXPECT_EQ(render({"--take", "none"}).exit_code, 66);
  EXPECT_EQ(cnerf({"render", out, "--views", "view_000"}).exit_code, 64) << "which a path has not";
  const ProgramResult grey = cnerf({"render", tiny_run().string(), "--photographs"});
  EXPECT_EQ(grey.exit_code, 64);
  EXPECT_THAT(grey.err, HasSubstr("has no take yet"));
}

TEST(KeyFrames, AndHintsOverruleTheColorizer) {
  const TempDir folder;
  const std::string out = (folder / "run").string();
  ASSERT_EQ(train(tiny_capture(), out, {"--set", "stage1.steps=600"}).exit_code, 0) << "enough to have surfaces";
  const std::string truth = (tiny_capture() / "color/view_004.png").string();
  ASSERT_TRUE(fs::exists(truth));
  const auto colorize = [&](const std::string& take, const std::vector<std::string>& known) {
    const auto arguments =
        concatenated({"colorize", out, "--colorizer", "grey", "--take", take, "--set", "stage2.patches=60", "--set",
                      "stage2.purify.enabled=true", "--set", "stage2.distill_steps=60"},
                     known);
    const ProgramResult result = cnerf(arguments);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(cnerf({"eval", out, "--take", take}).exit_code, 0);
    return json_of(folder / "run/takes" / take / "metrics.json").at("mean").at("ab_error").get<double>();
  };
  const double grey = colorize("plain", {});
  const double painted = colorize("painted", {"--keyframe", "view_004=" + truth});
  EXPECT_LT(painted, 0.9 * grey) << "what the key frame shows has its colours in other views";
  EXPECT_THAT(json_of(folder / "run/takes/painted/take.json").at("colorizer").get<std::string>(),
              HasSubstr("grey + key frame"));

  const double hinted = colorize("hinted", {"--hint", "24,30,view_004,#ff0000"});
  EXPECT_NE(hinted, grey);
  const ProgramResult missing = cnerf({"colorize", out, "--keyframe", "zebra=" + truth});
  EXPECT_EQ(missing.exit_code, 64) << missing.err;
  EXPECT_THAT(missing.err, HasSubstr("zebra"));
}

TEST(KeyFrames, ColorWhatTheyDoNotShowWhereTheCommandNamesNoColorizer) {
  const TempDir folder;
  const std::string out = (folder / "run").string();
  ASSERT_EQ(train(tiny_capture(), out, {"--set", "colorizer.spec=builtin"}).exit_code, 0) << "as cnerf run chooses";
  const std::string painted = "view_004=" + (tiny_capture() / "color/view_004.png").string();
  const auto colorizer_of = [&](const std::string& take, const std::vector<std::string>& more) {
    const ProgramResult result =
        cnerf(concatenated({"colorize", out, "--take", take, "--keyframe", painted, "--set",
                            "colorizer.reference_steps=10", "--set", "colorizer.reference_on_builtin=false"},
                           more));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return json_of(folder / "run/takes" / take / "take.json").at("colorizer").get<std::string>();
  };
  EXPECT_THAT(colorizer_of("painted", {}), HasSubstr("reference:"));
  EXPECT_THAT(colorizer_of("asked", {"--colorizer", "grey"}), HasSubstr("grey + key frame"));
}

TEST(Pipeline, BaseCandidatesAreShownWithoutMakingATake) {
  const TempDir folder;
  const std::string out = copied(tiny_run(), folder / "run").string();
  const ProgramResult result = cnerf({"colorize", out, "--colorizer", "grey", "--bases-only"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_FALSE(cv::imread((folder / "run/bases.png").string()).empty());
  EXPECT_FALSE(fs::exists(folder / "run/takes"));
  EXPECT_EQ(cnerf({"colorize", out, "--colorizer", "grey", "--bases", "2,99"}).exit_code, 64);
}

TEST(ColorizeImage, ColorizesOnePicture) {
  const TempDir folder;
  const std::string in = (tiny_capture() / "images/view_000.png").string(), out = (folder / "out.png").string();
  // A program that answers a = L / 4, b = -10 everywhere.
  write_file(folder / "warm.py", R"(
import struct, sys
while True:
    head = sys.stdin.buffer.read(20)
    if len(head) < 20: break
    _, _, b, h, w = struct.unpack("<4s4I", head)
    values = struct.unpack("<%df" % (b * h * w), sys.stdin.buffer.read(4 * b * h * w))
    sys.stdout.buffer.write(struct.pack("<4s5I", b"CNA1", 0, b, 2, h, w))
    sys.stdout.buffer.write(struct.pack("<%df" % (2 * b * h * w), *[v / 4 for v in values], *[-10.0] * (b * h * w)))
    sys.stdout.buffer.flush()
)");
  const std::vector<std::string> call = {"colorize-image", in, out, "--colorizer",
                                         "exec:python3 " + (folder / "warm.py").string()};
  const ProgramResult result = cnerf(call);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const cv::Mat picture = cv::imread(out), source = cv::imread(in);
  ASSERT_EQ(picture.size(), source.size());
  double red_over_green = 0;
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      const auto& pixel = picture.at<cv::Vec3b>(y, x);
      red_over_green += pixel[2] - pixel[1];
    }
  }
  EXPECT_GT(red_over_green / double(picture.total()), 3);
  EXPECT_EQ(cnerf(call).exit_code, 64) << "an existing picture is not replaced unasked";
  EXPECT_EQ(
      cnerf({"colorize-image", in, (folder / "p.png").string(), "--prompt", "red", "--colorizer", "grey"}).exit_code,
      64);
}

TEST(ColorizeImage, TurnsAPhotographUpright) {
  const TempDir folder;
  write_file(folder / "photo.jpg", turned_photograph(6));
  const std::string out = (folder / "out.png").string();
  const ProgramResult result = cnerf({"colorize-image", (folder / "photo.jpg").string(), out, "--colorizer", "grey"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const cv::Mat3b picture = cv::imread(out);
  ASSERT_EQ(picture.size(), cv::Size(40, 20));
  EXPECT_GT(picture(10, 5)[1], picture(10, 35)[1]) << "red is lighter than blue";
}

TEST(Pipeline, ProgressAsJson) {
  const TempDir folder;
  const ProgramResult result = train(tiny_capture(), folder / "run", {"--progress", "json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  std::istringstream lines(result.out);
  double last = 0;
  for (std::string line; std::getline(lines, line);) {
    const nlohmann::json json = nlohmann::json::parse(line);
    if (json.at("event") == "progress") last = json.at("fraction");
  }
  EXPECT_EQ(last, 1.0);
}

}  // namespace
}  // namespace cnerf::test
