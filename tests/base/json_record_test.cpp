#include "src/base/json_record.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "tests/support/data.h"

namespace cnerf::test {
namespace {
using Json = nlohmann::ordered_json;

struct Inner {
  std::string name;
  std::optional<double> psnr;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("name", self.name);
    v("psnr", self.psnr);
  }
};

struct Outer {
  int seed = 1;
  bool is_done = false;
  std::string error;
  Inner best;
  std::vector<Inner> all;
  std::array<float, 2> size = {};
  std::map<std::string, double> seconds;
  std::filesystem::path file;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("seed", self.seed);
    v("is_done", self.is_done);
    v("error", self.error, kOptional);
    v("best", self.best);
    v("all", self.all);
    v("size", self.size);
    v("seconds", self.seconds);
    v("file", self.file, kOptional);
  }
};

Outer filled() {
  return {3, true, "", {"a", 20.5}, {{"b", {}}, {"c", 1}}, {1.5f, 2}, {{"train", 1.25}}, "x/y"};
}

std::string refusal_of_change(const std::function<void(Json&)>& change) {
  Json json = json_of(filled());
  change(json);
  try {
    (void)record_of<Outer>(json, "cell.json");
  } catch (const InputError& error) {
    return error.what();
  }
  return "(nothing was thrown)";
}

TEST(JsonRecord, WritesFieldsInOrderAndLeavesOutWhatIsEmpty) {
  EXPECT_EQ(json_of(filled()).dump(),
            R"({"seed":3,"is_done":true,"best":{"name":"a","psnr":20.5},"all":[{"name":"b"},{"name":"c","psnr":1.0}],)"
            R"("size":[1.5,2.0],"seconds":{"train":1.25},"file":"x/y"})");
}

TEST(JsonRecord, APathEndsWhereItsTextDoes) {
  EXPECT_THAT(refusal_of_change([](Json& json) { json["file"] = std::string("a\0b", 3); }),
              testing::HasSubstr("cell.json: file"));
}

TEST(JsonRecord, ReadsWhatItWrote) {
  const test::TempDir folder;
  write_file(folder / "cell.json", json_of(filled()).dump());
  EXPECT_EQ(json_of(read_record<Outer>(folder / "cell.json")), json_of(filled()));
}

TEST(JsonRecord, ErrorsNameFileAndField) {
  EXPECT_EQ(refusal_of_change([](Json& json) { json.erase("seed"); }), "cell.json: seed: is missing");
  EXPECT_EQ(refusal_of_change([](Json& json) { json["all"][1]["name"] = 4; }), "cell.json: all[1].name: got 4");
  EXPECT_EQ(refusal_of_change([](Json& json) { json["best"] = "a"; }),
            "cell.json: best: expected an object, got \"a\"");
  EXPECT_EQ(refusal_of_change([](Json& json) { json["size"].push_back(3); }),
            "cell.json: size: expected 2 values, got [1.5,2.0,3]");
  EXPECT_EQ(refusal_of_change([](Json& json) { json["seconds"]["train"] = "long"; }),
            "cell.json: seconds.train: got \"long\"");
  EXPECT_EQ(refusal_of_change([](Json& json) { json["seed"] = 1.5; }), "cell.json: seed: got 1.5");
  EXPECT_EQ(refusal_of_change([](Json& json) { json["is_done"] = 1; }), "cell.json: is_done: got 1");
  EXPECT_EQ(refusal_of_change([](Json& json) { json["seed"] = 4294967297; }), "cell.json: seed: got 4294967297");
  EXPECT_EQ(refusal_of_change([](Json& json) { json["seed"] = std::uint64_t(1) << 63; }),
            "cell.json: seed: got 9223372036854775808");
  EXPECT_EQ(refusal_of_change([](Json& json) { json["size"][0] = 1e39; }), "cell.json: size[0]: got 1e+39");
  EXPECT_EQ(refusal_of_change([](Json& json) { json = Json::array(); }), "cell.json: expected an object, got []");
  EXPECT_EQ(refusal_of_change([](Json& json) { json["later"] = 1; }), "(nothing was thrown)") << "of a later version";
}

TEST(JsonRecord, AFileThatIsNoJsonIsRefusedAsTheCallerWants) {
  const test::TempDir folder;
  write_file(folder / "cell.json", std::string("{\"seed\": "));
  EXPECT_THROW((void)read_record<Outer>(folder / "cell.json"), InputError);
  EXPECT_THROW((void)(read_record<Outer, SnapshotError>(folder / "cell.json")), SnapshotError);
  EXPECT_THROW((void)read_record<Outer>(folder / "missing.json"), MissingInputError);
}

}  // namespace
}  // namespace cnerf::test
