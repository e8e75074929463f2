/// Bad input: a distinct exit code, a message that names file, field and value, and no output.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>

#include "src/base/files.h"
#include "tests/e2e/program.h"
#include "tests/support/data.h"

namespace cnerf::test {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;

struct Case {
  const char* name;
  std::function<void(const fs::path& capture)> spoil;  ///< what is wrong with a copy of the tiny capture
  std::vector<std::string> options;
  int exit_code;
  std::vector<std::string> message;  ///< parts
};

nlohmann::json read_poses(const fs::path& capture) {
  return nlohmann::json::parse(read_text_file(capture / "transforms.json"));
}

void write_poses(const fs::path& capture, const nlohmann::json& poses) {
  write_file(capture / "transforms.json", poses.dump());
}

/// Changes transforms.json.
std::function<void(const fs::path&)> with_poses(const std::function<void(nlohmann::json&)>& change) {
  return [change](const fs::path& capture) {
    nlohmann::json poses = read_poses(capture);
    change(poses);
    write_poses(capture, poses);
  };
}

void nothing(const fs::path&) {}

fs::path first_image(const fs::path& capture) {
  const std::string listed = read_poses(capture).at("frames").at(0).at("file_path");
  return fs::exists(capture / listed) ? capture / listed : capture / (listed + ".png");
}

std::vector<Case> cases() {
  const std::vector<std::string> grey = {"--grey"};
  return {
      {"Unknown key",
       nothing,
       {"--grey", "--set", "stage1.stesp=3"},
       64,
       {"stage1.stesp", "did you mean 'stage1.steps'"}},
      {"Out of range", nothing, {"--grey", "--set", "stage1.steps=0"}, 64, {"stage1.steps", "got 0"}},
      {"Unknown preset", nothing, {"--grey", "--preset", "qick"}, 64, {"did you mean 'quick'"}},
      {"Unknown option", nothing, {"--grey", "--presett", "quick"}, 64, {"--presett", "did you mean '--preset'"}},
      {"Unknown colorizer", nothing, {"--colorizer", "magic:x"}, 64, {"magic"}},
      {"No CUDA", nothing, {"--grey", "--device", "cuda"}, 69, {"cuda"}},
      {"Missing config file", nothing, {"--grey", "--config", "/absent/c.toml"}, 66, {"/absent/c.toml"}},
      {"No capture", [](const fs::path& c) { fs::remove_all(c); }, grey, 66, {"capture"}},
      {"Empty folder",
       [](const fs::path& c) { fs::remove_all(c), fs::create_directories(c); },
       grey,
       66,
       {"transforms.json", "poses_bounds.npy"}},
      {"Broken JSON",
       [](const fs::path& c) { write_file(c / "transforms.json", std::string_view("{\"frames\": [")); },
       grey,
       65,
       {"transforms.json"}},
      {"One view",
       with_poses([](auto& poses) { poses["frames"].erase(1), poses["frames"] = {poses["frames"][0]}; }),
       grey,
       65,
       {"transforms.json"}},
      {"NaN pose",
       with_poses([](auto& poses) { poses["frames"][0]["transform_matrix"][0][0] = nullptr; }),
       grey,
       65,
       {"transforms.json", "frames[0]", "transform_matrix"}},
      {"Sheared pose",
       with_poses([](auto& poses) { poses["frames"][0]["transform_matrix"][0][0] = 5.0; }),
       grey,
       65,
       {"transforms.json", "frames[0]", "transform_matrix"}},
      {"Truncated image",
       [](const fs::path& c) {
         const fs::path image = first_image(c);
         fs::resize_file(image, fs::file_size(image) / 2);
       },
       grey,
       65,
       {".png"}},
      {"Cut-short npy",
       [](const fs::path& c) {
         fs::remove(c / "transforms.json");
         write_file(c / "poses_bounds.npy", std::string_view("\x93NUMPY\x01"));
       },
       grey,
       65,
       {"poses_bounds.npy"}},
      {"Missing reference", nothing, {"--colorizer", "reference:absent.jpg"}, 66, {"absent.jpg"}},
  };
}

class BadInput : public testing::TestWithParam<int> {};

TEST_P(BadInput, IsRefusedByNameWithItsExitCode) {
  const Case bad = cases()[std::size_t(GetParam())];
  SCOPED_TRACE(bad.name);
  const TempDir folder;
  const fs::path capture = folder / "capture", out = folder / "out";
  fs::copy(tiny_capture(), capture, fs::copy_options::recursive);
  bad.spoil(capture);
  const auto options = concatenated(tiny_options(), bad.options);
  const ProgramResult result = cnerf(concatenated({"run", capture.string(), "-o", out.string()}, options));
  EXPECT_EQ(result.exit_code, bad.exit_code) << result.err;
  for (const std::string& part : bad.message) EXPECT_THAT(result.err, HasSubstr(part));
  for (const std::string& file : files_below(out)) {
    EXPECT_THAT(file, testing::Not(HasSubstr("partial"))) << "a half-written file";
    EXPECT_THAT(file, testing::Not(testing::EndsWith(".vdb")));
  }
  EXPECT_FALSE(fs::exists(out / "run.json")) << "what can be refused at once is refused before the run begins";
}

std::string case_name(const testing::TestParamInfo<int>& info) {
  std::string name = cases()[std::size_t(info.param)].name;
  std::erase_if(name, [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; });
  return name;
}

INSTANTIATE_TEST_SUITE_P(Table, BadInput, testing::Range(0, int(cases().size())), case_name);

TEST(BadColorizer, OneThatFailsLeavesNoTake) {
  const TempDir folder;
  const fs::path out = folder / "out";
  const ProgramResult result = cnerf(
      concatenated({"run", tiny_capture().string(), "-o", out.string(), "--colorizer", "exec:false"}, tiny_options()));
  EXPECT_EQ(result.exit_code, 76) << result.err;
  EXPECT_THAT(result.err, HasSubstr("exec:false"));
  for (const std::string& file : files_below(out)) {
    EXPECT_THAT(file, testing::Not(testing::AnyOf(HasSubstr("partial"), testing::EndsWith("take.json"),
                                                  testing::EndsWith("take.snapshot"), testing::EndsWith(".vdb"))));
  }
}

TEST(BadOutput, AnUnwritableFolderIsAnOutputError) {
  const TempDir folder;
  write_file(folder / "file", std::string_view("x"));
  const auto arguments = concatenated(
      {"run", tiny_capture().string(), "-o", (folder / "file" / "run").string(), "--grey"}, tiny_options());
  EXPECT_EQ(cnerf(arguments).exit_code, 73);
}

TEST(BadOutput, ANameThatIsTooLongIsAnOutputErrorAndOfAnInputAnInputError) {
  const TempDir folder;
  const std::string run = copied(tiny_run(), folder / "run").string(), name = (folder / std::string(300, 'n')).string();
  for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{
           {"train", tiny_capture().string()}, {"bake", run}, {"render", run, "--path", "held-out"}}) {
    const ProgramResult result = cnerf(concatenated(words, {"-o", name}));
    EXPECT_EQ(result.exit_code, 73) << words.front() << ": " << result.err;
  }
  const ProgramResult input = cnerf({"info", name});
  EXPECT_EQ(input.exit_code, 65);
  EXPECT_THAT(input.err, HasSubstr(name + ": "));
}

TEST(BadOutput, MetricsAreWrittenOnceAllElseOfAnEvaluationIs) {
  const TempDir folder;
  const fs::path run = copied(tiny_run(), folder / "run");
  fs::remove(run / "metrics.json");
  fs::remove(run / "contact_sheet.png");
  fs::create_directories(run / "contact_sheet.png/taken");
  EXPECT_EQ(cnerf({"eval", run.string()}).exit_code, 73);
  EXPECT_FALSE(fs::exists(run / "metrics.json")) << "cnerf run --resume evaluates where it is missing";
}

TEST(BadOutput, ASomeoneElsesFolderIsLeftAlone) {
  const TempDir folder;
  write_file(folder / "thesis.txt", std::string_view("x"));
  const auto arguments =
      concatenated({"run", tiny_capture().string(), "-o", folder.path().string(), "--grey"}, tiny_options());
  EXPECT_EQ(cnerf(arguments).exit_code, 64);
  EXPECT_EQ(files_below(folder.path()), std::vector<std::string>{"thesis.txt"});
}

TEST(BadOutput, UnknownCommandsAndRunsAreRefused) {
  EXPECT_THAT(cnerf({"trian", "x"}).err, HasSubstr("did you mean 'train'"));
  EXPECT_EQ(cnerf({"trian", "x"}).exit_code, 64);
  EXPECT_EQ(cnerf({}).exit_code, 64);
  EXPECT_EQ(cnerf({"eval", "/absent/run"}).exit_code, 66);
  EXPECT_EQ(cnerf({"eval", tiny_capture().string()}).exit_code, 66);
}

TEST(BadRun, ACaptureThatIsNoneIsNamedByTheRecordThatNamesIt) {
  const TempDir folder;
  const fs::path run = copied(tiny_run(), folder / "run");
  nlohmann::json record = nlohmann::json::parse(read_text_file(run / "run.json"));
  write_file(folder / "text.txt", std::string_view("no capture"));
  for (const fs::path& capture :
       {folder.path(), folder / "gone", folder / std::string(5000, '9'), folder / "text.txt"}) {
    record["capture"] = capture.string();
    write_file(run / "run.json", record.dump());
    const ProgramResult result = cnerf({"eval", run.string()});
    EXPECT_EQ(result.exit_code, capture.extension() == ".txt" ? 65 : 66);
    EXPECT_THAT(result.err, HasSubstr("run.json: capture: " + capture.string() + ":"));
    EXPECT_THAT(result.err, HasSubstr("--capture says where it lies now"));
    EXPECT_THAT(cnerf({"eval", run.string(), "--capture", capture.string()}).err,
                testing::Not(HasSubstr("run.json: capture")));
  }
}

}  // namespace
}  // namespace cnerf::test
