// The studio by its answers, as a page gets them: frames, strokes, what they reach, colouring, takes.

#include "src/studio/studio.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <opencv2/imgcodecs.hpp>
#include <thread>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/capture/arrangement.h"
#include "src/picture/encode.h"
#include "src/pipeline/train_step.h"
#include "src/sample/sample_scene.h"
#include "src/studio/paint_files.h"
#include "tests/studio/state.h"
#include "tests/support/data.h"
#include "tests/support/exif_jpeg.h"
#include "tests/support/full_disk.h"
#include "tests/support/tiny_config.h"

namespace cnerf::studio {
namespace {
namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;
using web::PageAnswer;
constexpr const char* kPainter = "painter123";
const RetouchOptions kQuick = {.steps = 40, .known_pixels = 512, .kept_pixels = 512};

Config studio_config() {
  Config config = test::tiny_config();
  config.capture.holdout = 4;
  config.stage2.patches = config.stage2.distill_steps = 12;
  config.stage2.patch_size = 32;
  return config;
}

/// A trained run, made once.
class TrainedRun {
 public:
  static pipeline::RunContext& get() {
    static TrainedRun run;
    return *run.context_;
  }

 private:
  TrainedRun() {
    write_sample_scene(folder_ / "capture", {.views = 8, .width = 96, .height = 72, .samples_per_pixel = 1});
    Observer observer;
    const Config config = studio_config();
    context_.emplace(pipeline::RunContext{pipeline::RunDirectory(folder_ / "run"),
                                          config,
                                          pipeline::read_capture(folder_ / "capture", config, observer),
                                          {"cnerf", "train"}});
    pipeline::begin_run(*context_, folder_ / "capture", {});
    pipeline::train_step(*context_, {}, cpu_engines(), observer);
  }
  test::TempDir folder_;
  std::optional<pipeline::RunContext> context_;
};

/// A studio whose worker runs beside the test.
class StudioTest : public testing::Test {
 protected:
  void TearDown() override {
    close();
    fs::remove_all(context_.directory.root() / "strokes");
    fs::remove_all(context_.directory.root() / "takes");
  }
  void open(const std::string& take = "") {
    studio_ = std::make_unique<Studio>(context_, take, cpu_engines(), observer_, kQuick);
    worker_ = std::thread([this] { studio_->run(); });
    studio_->joined(kPainter);
    (void)wait_until([](const json& state) { return state["ready"] == true && test::is_idle(state); });
  }
  /// With what was shown last.
  void go_on(bool waits = true) {
    studio_ = std::make_unique<Studio>(context_, std::nullopt, cpu_engines(), observer_, kQuick);
    worker_ = std::thread([this] { studio_->run(); });
    studio_->joined(kPainter);
    if (waits) (void)wait_until([](const json& state) { return state["ready"] == true && test::is_idle(state); });
  }
  void close() {
    if (!studio_) return;
    studio_->close();
    worker_.join();
    studio_.reset();
  }

  PageAnswer send_picture(const std::map<std::string, std::string>& parameters, const std::string& bytes) {
    return studio_->answer({"POST", "/studio/pictures", parameters, kPainter, {}, bytes});
  }
  PageAnswer get(const std::string& path) { return studio_->answer({"GET", "/studio/" + path, {}, kPainter, {}, {}}); }
  PageAnswer post(const std::string& path, const json& body, const std::string& client = kPainter) {
    return studio_->answer({"POST", "/studio/" + path, {}, client, {}, body.dump()});
  }
  PageAnswer put(const std::vector<json>& strokes, int revision, const std::string& client = kPainter) {
    return studio_->answer({"PUT", "/studio/strokes", {}, client, revision, json{{"strokes", strokes}}.dump()});
  }
  PageAnswer put_with(const std::vector<json>& strokes, const std::vector<json>& viewpoints, int revision) {
    const json body = {{"strokes", strokes}, {"viewpoints", viewpoints}};
    return studio_->answer({"PUT", "/studio/strokes", {}, kPainter, revision, body.dump()});
  }
  json wait_until(const std::function<bool(const json&)>& holds) { return test::wait_until(*studio_, holds); }
  /// Gives an order and waits for its end.
  json ordered(const json& order) {
    EXPECT_EQ(post("orders", order).status, 202);
    return wait_until(test::is_idle);
  }
  [[nodiscard]] json stroke(const std::string& id, double x, double y) const {
    return {{"id", id},        {"view", context_.capture.views[1].name},
            {"kind", "paint"}, {"color", "#c03020"},
            {"size", 0.2},     {"points", std::vector<std::vector<double>>{{x, y, 1}}}};
  }
  /// Between two cameras of the capture, a little nearer to its middle.
  [[nodiscard]] json viewpoint(const std::string& name, double nearer = 0.95) const {
    const View& view = context_.capture.views[1];
    const CameraArrangement cameras = arrangement_of(context_.capture);
    Affined pose = view.world_from_camera;
    pose.translation = cameras.focus + (pose.translation - cameras.focus) * nearer;
    const Intrinsics lens = resized(view.intrinsics, 120, 80);
    return json::parse(json_of(Viewpoint{name, camera_record(lens, pose)}).dump());
  }
  /// A large stroke on it.
  [[nodiscard]] json stroke_on(const std::string& view, const std::string& id = "v") const {
    json large = stroke(id, 0.5, 0.5);
    large["view"] = view;
    large["size"] = 0.5;
    large["reach"] = 4;
    return large;
  }
  [[nodiscard]] std::string address(const char* of, std::size_t viewpoint) const {
    return of + std::to_string(context_.capture.views.size() + viewpoint);
  }
  static int colored_pixels(const PageAnswer& answer) {
    const cv::Mat picture = decoded(answer);
    EXPECT_EQ(picture.channels(), 4) << answer.body;
    int count = 0;
    for (int i = 0; i < int(picture.total()); ++i)
      count += picture.at<cv::Vec4b>(i / picture.cols, i % picture.cols)[3] > 0;
    return count;
  }
  [[nodiscard]] json frame(const std::vector<std::string>& sides) const {
    json view = json::parse(json_of(scene_of(context_.capture, "run")).dump())["views"][1];
    return {{"position", view["position"]}, {"rotation", view["rotation"]}, {"lens", view["lens"]}, {"sides", sides}};
  }
  static cv::Mat decoded(const PageAnswer& answer) {
    return cv::imdecode(std::vector<char>(answer.body.begin(), answer.body.end()), cv::IMREAD_UNCHANGED);
  }
  /// Mean distance of the channels of a picture from their mean.
  static double colorfulness(const cv::Mat& picture) {
    double sum = 0;
    for (int y = 0; y < picture.rows; ++y) {
      for (int x = 0; x < picture.cols; ++x) {
        const auto& p = picture.at<cv::Vec3b>(y, x);
        sum += std::max({p[0], p[1], p[2]}) - std::min({p[0], p[1], p[2]});
      }
    }
    return sum / double(picture.total());
  }

  pipeline::RunContext& context_ = TrainedRun::get();
  Observer observer_;
  std::unique_ptr<Studio> studio_;
  std::thread worker_;
};

TEST_F(StudioTest, FramesAreOfTheSizeThatIsAskedForOneBehindTheOther) {
  open();
  const PageAnswer one = post("frame", frame({"grey"}));
  ASSERT_EQ(one.status, 200) << one.body;
  const Intrinsics& lens = context_.capture.views[1].intrinsics;
  EXPECT_EQ(decoded(one).size(), cv::Size(lens.width, lens.height));
  const PageAnswer two = post("frame", frame({"grey", "now"}));
  EXPECT_EQ(one.headers.at(0).first, "X-Cnerf-Colors");
  ASSERT_EQ(two.headers.at(1).first, "X-Cnerf-Sizes");
  const json sizes = json::parse("[" + two.headers.at(1).second + "]");
  ASSERT_EQ(sizes.size(), 2U);
  const std::size_t first = sizes[0];
  EXPECT_EQ(two.body.size(), first + std::size_t(sizes[1]));
  EXPECT_EQ(two.body.substr(0, first), one.body);
  EXPECT_EQ(decoded({.body = two.body.substr(first)}).size(), cv::Size(lens.width, lens.height));
}

TEST_F(StudioTest, FramesOfNoCameraAreRefusedByTheField) {
  open();
  const auto refused = [&](const std::function<void(json&)>& spoil) {
    json body = frame({"grey"});
    spoil(body);
    const PageAnswer answer = post("frame", body);
    EXPECT_GE(answer.status, 400);
    return answer.body;
  };
  EXPECT_THAT(refused([](json& f) { f["rotation"][0][0] = 3; }), HasSubstr("rotation"));
  EXPECT_THAT(refused([](json& f) { f["lens"]["width"] = 100000; }), HasSubstr("lens"));
  EXPECT_THAT(refused([](json& f) { f["lens"]["fx"] = 0; }), HasSubstr("focal length"));
  EXPECT_THAT(refused([](json& f) { f["position"][1] = 1e30; }), HasSubstr("position"));
  EXPECT_THAT(refused([](json& f) { f["sides"] = json::array(); }), HasSubstr("sides"));
  EXPECT_THAT(refused([](json& f) { f["sides"] = {"../../etc"}; }), HasSubstr("take"));
  EXPECT_THAT(refused([](json& f) { f["sides"] = {"evening"}; }), HasSubstr("evening"));
  EXPECT_THAT(refused([](json& f) { f.erase("lens"); }), HasSubstr("lens"));
}

TEST_F(StudioTest, StrokesAreSavedAsTheyAreMade) {
  open();
  EXPECT_EQ(json::parse(get("strokes").body)["revision"], 0) << "pages name it when they save";
  EXPECT_EQ(put({stroke("a", 0.5, 0.5)}, 0).status, 200);
  EXPECT_EQ(put({stroke("a", 0.5, 0.5), stroke("b", 0.2, 0.5)}, 1).status, 200);
  EXPECT_EQ(put({}, 1).status, 409) << "made from an older list";
  EXPECT_EQ(put({}, 2, "another123").status, 423);
  EXPECT_EQ(put({{{"id", "x"}}}, 2).status, 400);
  close();
  open();
  const json strokes = json::parse(get("strokes").body);
  EXPECT_EQ(strokes["revision"], 2);
  ASSERT_EQ(strokes["strokes"].size(), 2u);
  EXPECT_EQ(strokes["strokes"][1]["id"], "b");
}

TEST_F(StudioTest, AFullDiskIsToldAndNothingIsLost) {
  open();
  ASSERT_EQ(put({stroke("a", 0.5, 0.5)}, 0).status, 200);
  const fs::path file = context_.directory.root() / "strokes" / kStrokeFile;
  const std::string before = read_text_file(file);
  {
    const test::FullDisk full;
    EXPECT_EQ(put({stroke("a", 0.5, 0.5), stroke("b", 0.2, 0.2)}, 1).status, 507);
    EXPECT_EQ(ordered({{"order", "colour"}})["failed"], true) << "the painted pictures cannot be written";
  }
  EXPECT_EQ(read_text_file(file), before);
  EXPECT_EQ(json::parse(get("strokes").body)["strokes"].size(), 1u);
  EXPECT_EQ(put({stroke("a", 0.5, 0.5), stroke("b", 0.2, 0.2)}, 1).status, 200) << "and goes on";
  EXPECT_EQ(ordered({{"order", "colour"}})["failed"], false);
}

TEST_F(StudioTest, APenIsFreeWhenItsTabIsClosed) {
  open();
  studio_->joined("another123");
  EXPECT_EQ(put({stroke("a", 0.5, 0.5)}, 0).status, 200);
  EXPECT_EQ(put({}, 1, "another123").status, 423);
  studio_->left(kPainter);
  EXPECT_EQ(put({}, 1, "another123").status, 200);
}

TEST_F(StudioTest, ADamagedStrokeFileIsRefusedAndKept) {
  const fs::path file = context_.directory.root() / "strokes/strokes.json";
  write_file(file, "{\"strokes\": [{\"id\": 3}]}");
  EXPECT_THROW(open(), InputError);
  EXPECT_EQ(read_text_file(file), "{\"strokes\": [{\"id\": 3}]}");
}

TEST_F(StudioTest, ReachShowsWhatStrokesWillColorInTheirViewAndOthers) {
  open();
  const PageAnswer nothing = get("reach/1");
  ASSERT_EQ(nothing.status, 200) << nothing.body;
  EXPECT_EQ(colored_pixels(nothing), 0);
  const PageAnswer drawn = post("reach", json{{"view", 1}, {"strokes", {stroke("a", 0.5, 0.5)}}});
  EXPECT_GT(colored_pixels(drawn), 20);
  EXPECT_EQ(colored_pixels(get("reach/1")), 0) << "it is not saved";
  EXPECT_EQ(put({stroke("a", 0.5, 0.5)}, 0).status, 200);
  EXPECT_EQ(get("reach/1").body, drawn.body);
  EXPECT_GT(colored_pixels(get("reach/2")), 5) << "the next camera sees some of it";
  EXPECT_EQ(get("reach/99").status, 404);
  EXPECT_EQ(get("reach/0").status, 404) << "held out";
}

TEST_F(StudioTest, ColouringGoesToAllViewsAndIsKept) {
  open();
  const auto shown = [&] { return colorfulness(decoded(post("frame", frame({"now"})))); };
  EXPECT_LT(shown(), 2) << "grey";
  json large = stroke("a", 0.5, 0.5);
  large["size"] = 0.5;
  large["reach"] = 4;
  EXPECT_EQ(put({large}, 0).status, 200);
  const json settled = ordered({{"order", "colour"}});
  EXPECT_EQ(settled["failed"], false) << settled;
  EXPECT_EQ(settled["unkept"], true);
  EXPECT_GT(settled["colors"], 1);
  EXPECT_THAT(settled["commands"].dump(), HasSubstr("--strokes"));
  EXPECT_GT(shown(), 10);
  EXPECT_TRUE(fs::exists(context_.directory.root() / "strokes"));

  const json kept = ordered({{"order", "keep"}, {"name", "red"}});
  EXPECT_EQ(kept["unkept"], false);
  ASSERT_EQ(kept["takes"].size(), 1u);
  EXPECT_EQ(context_.directory.record().current_take, "red");
  const double now = shown();
  EXPECT_NEAR(colorfulness(decoded(post("frame", frame({"red"})))), now, 0.01) << "the take is what was seen";
  (void)ordered({{"order", "begin"}, {"take", ""}});
  EXPECT_LT(shown(), 2);
  (void)ordered({{"order", "begin"}, {"take", "red"}});
  EXPECT_NEAR(shown(), now, 0.01);
}

TEST_F(StudioTest, AJournalIsReplayedBitForBit) {
  open();
  EXPECT_EQ(put({stroke("a", 0.5, 0.5)}, 0).status, 200);
  (void)ordered({{"order", "colour"}});
  EXPECT_EQ(put({stroke("a", 0.5, 0.5), stroke("b", 0.3, 0.6)}, 1).status, 200);
  (void)ordered({{"order", "colour"}});
  (void)ordered({{"order", "keep"}, {"name", "red"}});
  close();
  const fs::path file = context_.directory.take_folder("red") / kJournalFile;
  const Journal journal = read_journal(file, paintable_views(context_.capture));
  ASSERT_EQ(journal.deeds.size(), 3u);
  Coloring again(context_, cpu_engines());
  again.replay(journal, kQuick, [](double) {});
  again.keep("red-2", 0, observer_);
  EXPECT_EQ(read_binary_file(context_.directory.take_snapshot("red")),
            read_binary_file(context_.directory.take_snapshot("red-2")));
  EXPECT_THROW(again.keep("red", 0, observer_), UsageError);
  write_file(context_.directory.take_folder("red") / "metrics.json", std::string_view("{}"));
  again.keep("red", 0, observer_, /*overwrite=*/true);
  EXPECT_FALSE(fs::exists(context_.directory.take_folder("red") / "metrics.json")) << "of the take before";
  EXPECT_TRUE(context_.directory.take_record("red").has_value());
}

TEST_F(StudioTest, StrokesThatColorEverythingReachAllAndAreReplayedBitForBit) {
  open();
  const json list = {stroke("a", 0.5, 0.5), stroke("b", 0.3, 0.6)};
  const auto reached = [&](bool everywhere) {
    return colored_pixels(post("reach", {{"view", 1}, {"strokes", list}, {"everywhere", everywhere}}));
  };
  EXPECT_GT(reached(true), 2 * reached(false)) << "as the page asks before they are saved";
  const json body = {{"strokes", list}, {"everywhere", true}};
  EXPECT_EQ(studio_->answer({"PUT", "/studio/strokes", {}, kPainter, 0, body.dump()}).status, 200);
  EXPECT_TRUE(read_strokes(stroke_folder(context_) / kStrokeFile, paintable_views(context_.capture)).everywhere);
  (void)ordered({{"order", "colour"}});
  (void)ordered({{"order", "keep"}, {"name", "all"}});
  close();
  const fs::path folder = context_.directory.take_folder("all");
  const Journal journal = read_journal(folder / kJournalFile, paintable_views(context_.capture));
  EXPECT_TRUE(journal.deeds.back().everywhere);
  Coloring again(context_, cpu_engines());
  again.replay(journal, kQuick, [](double) {});
  again.keep("all-2", 0, observer_);
  EXPECT_EQ(read_binary_file(context_.directory.take_snapshot("all")),
            read_binary_file(context_.directory.take_snapshot("all-2")));
}

TEST_F(StudioTest, JournalsOfAnyContentAreRefusedByName) {
  const fs::path file = context_.directory.root() / "strokes/journal.json";
  const PaintableViews views = paintable_views(context_.capture);
  json bad = stroke("a", 0.5, 0.5);
  bad["size"] = 7;
  const std::vector<json> strokes = {bad};
  for (const json& journal : {json(3), json{{"deeds", json::array()}}, json{{"deeds", {{{"base", "../../x"}}}}},
                              json{{"deeds", {json::object(), {{"strokes", strokes}, {"steps", 3}}}}},
                              json{{"deeds", {json::object(), {{"steps", "many"}}}}}}) {
    write_file(file, journal.dump());
    EXPECT_THROW((void)read_journal(file, views), Error) << journal;
  }
}

TEST_F(StudioTest, TakesAreDuplicatedRenamedAndDeleted) {
  open();
  EXPECT_EQ(put({stroke("a", 0.5, 0.5)}, 0).status, 200);
  (void)ordered({{"order", "colour"}});
  (void)ordered({{"order", "keep"}, {"name", "red"}});
  EXPECT_EQ(ordered({{"order", "duplicate"}, {"take", "red"}, {"name", "copy"}})["takes"].size(), 2u);
  EXPECT_EQ(read_binary_file(context_.directory.take_snapshot("red")),
            read_binary_file(context_.directory.take_snapshot("copy")));
  const json renamed = ordered({{"order", "rename"}, {"take", "red"}, {"name", "evening"}});
  EXPECT_EQ(renamed["takes"][1]["name"], "evening");
  EXPECT_EQ(context_.directory.record().current_take, "evening");
  EXPECT_EQ(ordered({{"order", "delete"}, {"take", "copy"}})["takes"].size(), 1u);
  EXPECT_FALSE(fs::exists(context_.directory.take_folder("copy")));
  for (const json& order :
       {json{{"order", "delete"}, {"take", "copy"}},
        json{{"order", "duplicate"}, {"take", "evening"}, {"name", "../x"}},
        json{{"order", "duplicate"}, {"take", "evening"}, {"name", "evening"}},
        json{{"order", "keep"}, {"name", "evening"}}, json{{"order", "keep"}, {"name", "now"}},
        json{{"order", "rename"}, {"take", "evening"}, {"name", "grey"}}, json{{"order", "begin"}, {"take", "no"}}}) {
    EXPECT_EQ(ordered(order)["failed"], true) << order;
  }
  EXPECT_EQ(json::parse(get("state").body)["takes"].size(), 1u);
}

TEST_F(StudioTest, AnyTwoOfManyTakesAreShownBesideEachOther) {
  open();
  EXPECT_EQ(put({stroke("a", 0.5, 0.5)}, 0).status, 200);
  (void)ordered({{"order", "colour"}});
  (void)ordered({{"order", "keep"}, {"name", "a"}});
  const std::vector<std::string> names = {"a", "b", "c", "d", "e"};
  for (std::size_t i = 1; i < names.size(); ++i) {
    (void)ordered({{"order", "duplicate"}, {"take", "a"}, {"name", names[i]}});
  }
  const std::string one = post("frame", frame({"a"})).body;
  for (const std::string& left : names) {
    for (const std::string& right : names) EXPECT_EQ(post("frame", frame({left, right})).body, one + one);
  }
}

TEST_F(StudioTest, BakesAreOfferedForDownload) {
  open();
  EXPECT_EQ(put({stroke("a", 0.5, 0.5)}, 0).status, 200);
  (void)ordered({{"order", "colour"}});
  const json baked = ordered({{"order", "bake"}, {"formats", {"vdb"}}});
  EXPECT_EQ(baked["failed"], false) << baked;
  EXPECT_TRUE(context_.directory.take_record("studio")) << "what was in no take is kept";
  ASSERT_EQ(baked["downloads"].size(), 1u) << baked;
  EXPECT_THAT(baked["blender"].get<std::string>(), HasSubstr("blender --python"));
  const std::string address = baked["downloads"][0]["address"];
  const PageAnswer file = get(address.substr(std::string("./studio/").size()));
  EXPECT_EQ(file.status, 200);
  EXPECT_EQ(fs::file_size(file.file), baked["downloads"][0]["bytes"]);
  EXPECT_EQ(get("files/7").status, 404);
  const json written = ordered({{"order", "photographs"}, {"format", "png"}});
  EXPECT_EQ(written["failed"], false) << written;
  EXPECT_EQ(written["downloads"].size(), context_.capture.views.size());
  EXPECT_FALSE(context_.directory.take_record("studio-2")) << "it was kept already";
  EXPECT_EQ(ordered({{"order", "bake"}, {"formats", {"stl"}}})["failed"], true);
  fs::remove_all(context_.directory.root() / "bakes");
  fs::remove_all(context_.directory.root() / "renders");
}

TEST_F(StudioTest, PicturesOfAnyContentAreRefusedByName) {
  open();
  const auto sent = [&](const std::string& kind, const std::string& bytes) {
    return send_picture({{"kind", kind}, {"name", "red.png"}}, bytes);
  };
  EXPECT_EQ(sent("reference", "").status, 400);
  EXPECT_THAT(sent("reference", "GIF89a?").body, HasSubstr("red.png"));
  EXPECT_EQ(sent("virus", "x").status, 400);
  const std::vector<std::byte> grey = png_bytes(Picture{8, 8, std::vector<std::uint8_t>(192, 90)});
  EXPECT_THAT(sent("reference", {reinterpret_cast<const char*>(grey.data()), grey.size()}).body, HasSubstr("grey"));
  EXPECT_TRUE(fs::is_empty(context_.directory.root() / "strokes/references")) << "nothing was kept";
}

TEST_F(StudioTest, AReferenceIsTurnedUpright) {
  open();
  const PageAnswer answer = send_picture({{"kind", "reference"}, {"name", "photo.jpg"}}, test::turned_photograph(6));
  EXPECT_EQ(answer.status, 202) << answer.body;
  const fs::directory_iterator files(context_.directory.root() / "strokes/references");
  ASSERT_TRUE(files != fs::directory_iterator());
  const cv::Mat3b kept = cv::imread(files->path().string());
  ASSERT_EQ(kept.size(), cv::Size(40, 20));
  EXPECT_GT(kept(10, 5)[2], 150) << "red";
  EXPECT_GT(kept(10, 35)[0], 150) << "blue";
}

/// It takes a minute on two processor cores.
TEST_F(StudioTest, AFitToAReferenceStopsAndFramesAreDrawnBesideIt) {
  open();
  const std::string photograph = test::turned_photograph(1);
  EXPECT_EQ(send_picture({{"kind", "reference"}, {"name", "photo.jpg"}}, photograph).status, 202);
  (void)wait_until([](const json& state) { return state["step"] == "reference colorizer"; });
  EXPECT_FALSE(decoded(post("frame", frame({"now"}))).empty());
  EXPECT_EQ(json::parse(get("state").body)["step"], "reference colorizer") << "still";
  EXPECT_EQ(post("orders", {{"order", "stop"}}).status, 202);
  const json stopped = wait_until(test::is_idle);
  EXPECT_THAT(stopped["message"].get<std::string>(), HasSubstr("stopped"));
  EXPECT_EQ(stopped["takes"].size(), 0u) << stopped["takes"];
}

TEST_F(StudioTest, TheFinishIsShownAtOnceAndBakedButNotTrained) {
  open();
  EXPECT_EQ(put({stroke("a", 0.5, 0.5)}, 0).status, 200);
  (void)ordered({{"order", "colour"}});
  const cv::Mat before = decoded(post("frame", frame({"now"})));
  const json state =
      json::parse(post("orders", {{"order", "finish"}, {"saturation", 0}, {"hue", 0}, {"exposure", 1}}).body);
  EXPECT_EQ(state["finish"]["exposure"], 1.0);
  const cv::Mat after = decoded(post("frame", frame({"now"})));
  EXPECT_LT(colorfulness(after), 0.3 * colorfulness(before)) << "JPEG leaves a little";
  EXPECT_GT(cv::mean(after)[1], 1.1 * cv::mean(before)[1]);
  EXPECT_EQ(json::parse(get("state").body)["unkept"], true);
  const json written = ordered({{"order", "photographs"}, {"format", "png"}});
  EXPECT_EQ(written["failed"], false) << written;
  EXPECT_THAT(written["commands"].back().get<std::string>(), HasSubstr("--set finish.saturation=0"));
  const std::string first = written["downloads"][0]["address"].get<std::string>().substr(9);
  EXPECT_LT(colorfulness(cv::imread(get(first).file.string())), 0.01) << "exposure and colour of the finish";
  for (const json& bad : {json{{"order", "finish"}, {"saturation", 9}}, json{{"order", "finish"}, {"hue", 181}},
                          json{{"order", "finish"}, {"exposure", "x"}}}) {
    EXPECT_EQ(post("orders", bad).status, 400) << bad;
  }
  fs::remove_all(context_.directory.root() / "renders");
}

TEST_F(StudioTest, SuggestionsAreCardsThatCanBeBegunFrom) {
  open();
  const json suggested = ordered({{"order", "suggest"}});
  EXPECT_EQ(suggested["failed"], false) << suggested;
  ASSERT_EQ(suggested["cards"].size(), 12u);
  EXPECT_EQ(decoded(get("cards/0")).rows, decoded(get("cards/11")).rows);
  EXPECT_EQ(get("cards/12").status, 404);
  const json colored = ordered({{"order", "builtin"}, {"bases", {0, 5}}});
  EXPECT_EQ(colored["failed"], false) << colored;
  EXPECT_EQ(colored["take"], "builtin");
  EXPECT_THAT(colored["commands"].back().get<std::string>(), HasSubstr("--colorizer builtin --bases 0,5"));
  EXPECT_EQ(ordered({{"order", "builtin"}, {"bases", {12}}})["failed"], true) << "no such card";
}

TEST_F(StudioTest, ViewsWorthPaintingAreNumberedAndThoseThatArePaintedAreNone) {
  open();
  const json state = ordered({{"order", "key-views"}});
  const json& found = state["key_views"];
  ASSERT_EQ(found.size(), 3u) << state.dump();
  const auto& views = context_.capture.views;
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_FALSE(views.at(found[i]["view"].get<std::size_t>()).held_out);
    if (i > 0) {
      EXPECT_LE(found[i]["adds"], found[i - 1]["adds"]);
    }
  }
  EXPECT_THAT(state["commands"].dump(), HasSubstr("--suggest-keyframes 3"));

  const int first = found[0]["view"];
  json hidden = stroke_on(views[std::size_t(found[1]["view"])].name, "h");
  hidden["hidden"] = true;
  ASSERT_EQ(put({stroke_on(views[std::size_t(first)].name), hidden}, 0).status, 200);
  const json again = ordered({{"order", "key-views"}})["key_views"];
  for (const json& one : again) EXPECT_NE(one["view"], first) << "it is painted";
  EXPECT_EQ(again[0]["view"], found[1]["view"]) << "what is hidden is not";
}

TEST_F(StudioTest, APaintedPictureBecomesAStroke) {
  open();
  const View& view = context_.capture.views[1];
  const auto sent = [&](const std::string& number, const cv::Mat& picture) {
    std::vector<std::uint8_t> png;
    cv::imencode(".png", picture, png);
    return send_picture({{"kind", "stroke"}, {"view", number}, {"name", "red.png"}}, {png.begin(), png.end()});
  };
  cv::Mat painted(2 * view.image.height, 2 * view.image.width, CV_8UC4, cv::Scalar(0, 0, 0, 0));
  painted(cv::Rect(0, 0, painted.cols / 2, painted.rows)).setTo(cv::Scalar(20, 30, 200, 255));
  ASSERT_EQ(sent("1", painted).status, 202) << sent("1", painted).body;
  const json strokes = json::parse(get("strokes").body);
  ASSERT_EQ(strokes["strokes"].size(), 1u);
  EXPECT_EQ(strokes["strokes"][0]["kind"], "picture");
  EXPECT_EQ(strokes["strokes"][0]["view"], view.name);
  EXPECT_EQ(put(strokes["strokes"].get<std::vector<json>>(), 1).status, 200) << "comes back as it went";
  const auto shown =
      studio_->answer({"GET", "/studio/painted", {{"picture", strokes["strokes"][0]["picture"]}}, kPainter, {}, {}});
  EXPECT_TRUE(fs::exists(shown.file));
  const cv::Mat reach = decoded(get("reach/1"));
  EXPECT_GT(reach.at<cv::Vec4b>(reach.rows / 2, reach.cols / 4)[3], 0);

  ASSERT_EQ(put_with({}, {viewpoint("viewpoint-1")}, 2).status, 200);
  cv::Mat there(160, 240, CV_8UC4, cv::Scalar(0, 0, 0, 0));
  there(cv::Rect(0, 0, 120, 160)).setTo(cv::Scalar(20, 30, 200, 255));
  ASSERT_EQ(sent(std::to_string(context_.capture.views.size()), there).status, 202);
  const json on_viewpoint = json::parse(get("strokes").body);
  EXPECT_EQ(on_viewpoint["strokes"][0]["view"], "viewpoint-1");
  EXPECT_EQ(on_viewpoint["viewpoints"].size(), 1u) << "it stays";

  EXPECT_EQ(sent("99", painted).status, 404);
  EXPECT_THAT(sent("0", painted).body, HasSubstr("held out"));
  EXPECT_THAT(sent("1", painted(cv::Rect(painted.cols / 2 - 9, 0, 18, painted.rows))).body, HasSubstr("shape"));
  EXPECT_THAT(sent("1", cv::Mat(painted.size(), CV_8UC4, cv::Scalar(9, 9, 9, 255))).body, HasSubstr("opaque"));
  EXPECT_THAT(sent("1", cv::Mat(painted.size(), CV_8UC4, cv::Scalar(9, 9, 9, 0))).body, HasSubstr("nothing"));
  for (const char* picture : {"../../../etc", "0123456789ab", ""}) {
    json bad = strokes["strokes"][0];
    bad["picture"] = picture;
    EXPECT_GE(put({bad}, 4).status, 400) << picture;
    EXPECT_EQ(studio_->answer({"GET", "/studio/painted", {{"picture", picture}}, kPainter, {}, {}}).status, 404);
  }
}

TEST_F(StudioTest, WhereThereAreTooManyStrokesNoPictureIsKept) {
  open();
  std::vector<json> many(kMostStrokes, stroke("a", 0.5, 0.5));
  for (std::size_t i = 0; i < many.size(); ++i) many[i]["id"] = "s" + std::to_string(i);
  ASSERT_EQ(put(many, json::parse(get("strokes").body)["revision"]).status, 200);
  const View& view = context_.capture.views[1];
  cv::Mat painted(view.image.height, view.image.width, CV_8UC4, cv::Scalar(0, 0, 0, 0));
  painted(cv::Rect(0, 0, 7, 5)).setTo(cv::Scalar(30, 200, 20, 255));
  std::vector<std::uint8_t> png;
  cv::imencode(".png", painted, png);
  const std::string bytes(png.begin(), png.end());
  const std::string name = sha256(std::as_bytes(std::span(bytes))).substr(0, 12) + ".png";
  const PageAnswer refused = send_picture({{"kind", "stroke"}, {"view", "1"}}, bytes);
  EXPECT_EQ(refused.status, 400) << refused.body;
  EXPECT_THAT(refused.body, HasSubstr("too many"));
  EXPECT_FALSE(fs::exists(context_.directory.root() / "strokes/painted" / name));
}

TEST_F(StudioTest, ViewpointsHavePicturesOfTheFieldAndNumbersAfterTheViews) {
  open();
  EXPECT_EQ(json::parse(get("strokes").body)["viewpoints"], json::array());
  EXPECT_EQ(get(address("photos/", 0)).status, 404);
  ASSERT_EQ(put_with({}, {viewpoint("viewpoint-1"), viewpoint("other", 0.8)}, 0).status, 200);
  EXPECT_EQ(json::parse(get("strokes").body)["viewpoints"], json({viewpoint("viewpoint-1"), viewpoint("other", 0.8)}));
  const PageAnswer photo = get(address("photos/", 0));
  EXPECT_EQ(decoded(photo).size(), cv::Size(120, 80));
  EXPECT_LT(colorfulness(decoded(photo)), 1) << "grey";
  EXPECT_EQ(get(address("photos/", 0)).body, photo.body);
  EXPECT_NE(get(address("photos/", 1)).body, photo.body);
  const auto small =
      studio_->answer({"GET", "/studio/" + address("photos/", 0), {{"side", "60"}, {"at", "7"}}, {}, {}, {}});
  EXPECT_EQ(decoded(small).size(), cv::Size(60, 40));
  EXPECT_EQ(decoded(get(address("thumbnails/", 1))).size(), cv::Size(120, 80));
  EXPECT_EQ(get(address("photos/", 2)).status, 404);

  ASSERT_EQ(put_with({}, {viewpoint("viewpoint-1", 0.8)}, 1).status, 200);
  EXPECT_NE(get(address("photos/", 0)).body, photo.body) << "it looks from elsewhere now";
  for (const char* of : {"photos/", "thumbnails/", "reach/"}) EXPECT_EQ(get(address(of, 1)).status, 404) << of;
}

TEST_F(StudioTest, ViewpointsAreRefusedByTheField) {
  open();
  json bad = viewpoint("viewpoint-2");
  bad["lens"]["fx"] = 0;
  const PageAnswer answer = put_with({}, {viewpoint("viewpoint-1"), bad}, 0);
  EXPECT_EQ(answer.status, 400);
  EXPECT_THAT(answer.body, HasSubstr("viewpoints[1].focal length"));
  EXPECT_THAT(put_with({}, {viewpoint("a"), viewpoint("a")}, 0).body, HasSubstr("viewpoints[1].name"));
  EXPECT_EQ(put_with({stroke_on("viewpoint-1")}, {}, 0).status, 400) << "no such view";
  EXPECT_EQ(put_with({stroke_on("viewpoint-1")}, {viewpoint("viewpoint-1")}, 0).status, 200);
  EXPECT_EQ(put_with({stroke_on("viewpoint-1")}, {}, 1).status, 400) << "it is painted on";
}

TEST_F(StudioTest, StrokesOnViewpointsReachViewsAndColorThem) {
  open();
  ASSERT_EQ(put_with({}, {viewpoint("viewpoint-1")}, 0).status, 200);
  EXPECT_EQ(colored_pixels(get(address("reach/", 0))), 0);
  const json drawn = {{"view", context_.capture.views.size()}, {"strokes", {stroke_on("viewpoint-1")}}};
  EXPECT_GT(colored_pixels(post("reach", drawn)), 100) << "before it is saved";
  EXPECT_EQ(colored_pixels(get("reach/1")), 0);
  ASSERT_EQ(put_with({stroke_on("viewpoint-1")}, {viewpoint("viewpoint-1")}, 1).status, 200);
  EXPECT_GT(colored_pixels(get(address("reach/", 0))), 100);
  EXPECT_GT(colored_pixels(get("reach/1")), 50);

  const json settled = ordered({{"order", "colour"}});
  EXPECT_EQ(settled["failed"], false) << settled;
  EXPECT_GT(colorfulness(decoded(post("frame", frame({"now"})))), 10) << "as a camera of the capture sees it";
  EXPECT_GT(colorfulness(decoded(get(address("thumbnails/", 0)))), 10);
  EXPECT_LT(colorfulness(decoded(get(address("photos/", 0)))), 1);
  for (const auto& entry : fs::directory_iterator(context_.directory.root() / "strokes")) {
    EXPECT_NE(entry.path().extension(), ".png") << "photographs have pictures of their paint, viewpoints none";
  }
  ASSERT_EQ(put_with({}, {}, 2).status, 200);
  EXPECT_EQ(colored_pixels(get("reach/1")), 0);
  EXPECT_EQ(get(address("reach/", 0)).status, 404);
  EXPECT_EQ(ordered({{"order", "colour"}})["failed"], false);
}

TEST_F(StudioTest, ViewpointsThatAreSeenLaterAreReachedByTheSameStrokes) {
  open();
  ASSERT_EQ(put_with({stroke("a", 0.5, 0.5)}, {viewpoint("first"), viewpoint("second", 0.8)}, 0).status, 200);
  EXPECT_GT(colored_pixels(get("reach/1")), 5);
  for (const std::size_t i : {0, 1}) EXPECT_GT(colored_pixels(get(address("reach/", i))), 5) << i;
}

TEST_F(StudioTest, TakesOfViewpointsAreKeptAndReplayedBitForBit) {
  open();
  const json first = viewpoint("viewpoint-1"), moved = viewpoint("viewpoint-1", 0.8), other = viewpoint("other", 0.9);
  EXPECT_EQ(put_with({stroke_on("viewpoint-1")}, {first}, 0).status, 200);
  (void)ordered({{"order", "colour"}});
  // Looked at in another order than they are painted in, one of them without paint, one where another was.
  EXPECT_EQ(put_with({stroke_on("other"), stroke_on("viewpoint-1", "w"), stroke("a", 0.2, 0.5)},
                     {viewpoint("empty", 0.7), other, moved}, 1)
                .status,
            200);
  for (const std::size_t i : {0, 2, 1}) EXPECT_EQ(get(address("reach/", i)).status, 200) << i;
  (void)ordered({{"order", "colour"}});
  (void)ordered({{"order", "keep"}, {"name", "red"}});
  const fs::path folder = context_.directory.take_folder("red");
  EXPECT_EQ(read_strokes(folder / kStrokeFile, paintable_views(context_.capture)).viewpoints.size(), 3u);
  EXPECT_THAT(context_.directory.take_record("red")->colorizer, HasSubstr("viewpoint-1"));
  close();
  const Journal journal = read_journal(folder / kJournalFile, paintable_views(context_.capture));
  ASSERT_EQ(journal.deeds.size(), 3u);
  EXPECT_EQ(journal.deeds[1].viewpoints.size(), 1u);
  EXPECT_EQ(journal.deeds[2].viewpoints.size(), 2u) << "those that are painted";
  Coloring again(context_, cpu_engines());
  again.replay(journal, kQuick, [](double) {});
  again.keep("red-2", 0, observer_);
  EXPECT_EQ(read_binary_file(context_.directory.take_snapshot("red")),
            read_binary_file(context_.directory.take_snapshot("red-2")));
}

TEST_F(StudioTest, ViewpointsComeBesideWorkAndGoBetweenIt) {
  Coloring coloring(context_, cpu_engines());
  coloring.cache_views([](double) {});
  const auto at = [&](const std::string& name, double nearer) {
    return record_of<Viewpoint>(parse_json(viewpoint(name, nearer).dump(), "test"), "test");
  };
  const std::vector<Viewpoint> one = {at("a", 0.9)}, moved = {at("a", 0.8)}, two = {at("a", 0.8), at("b", 0.7)};
  const std::size_t views = coloring.seen()->views().size();
  coloring.see(one, {});
  const SeenSurfaces before = coloring.seen()->first(views + 1);
  const CachedView* first = before.views().data();
  coloring.see(moved, {});
  coloring.see(two, {});
  EXPECT_EQ(coloring.seen()->views().data(), first) << "nothing moves";
  ASSERT_EQ(coloring.seen()->views().size(), views + 3);
  EXPECT_EQ(coloring.seen()->view_named("a"), views + 1) << "the later one";
  EXPECT_TRUE(coloring.has_seen(two));
  // A call that comes while another one traces.
  const std::vector<Viewpoint> third = {at("c", 0.6)};
  coloring.see(third, [&](double) { coloring.see(third, {}); });
  EXPECT_EQ(coloring.seen()->views().size(), views + 4);
  coloring.forget_others(moved);
  EXPECT_EQ(coloring.seen()->views().size(), views + 1);
  EXPECT_TRUE(coloring.has_seen(moved));
  EXPECT_FALSE(coloring.has_seen(two));
}

TEST_F(StudioTest, ATrainingIsWatchedStoppedAndGoneOnWith) {
  const test::TempDir folder;
  pipeline::RunContext context{pipeline::RunDirectory(folder / "run"), context_.config, context_.capture, {}};
  context.config.stage1.steps = 1000000;
  pipeline::begin_run(context, folder / "capture", {});
  studio_ = std::make_unique<Studio>(context, "", cpu_engines(), observer_, kQuick);
  worker_ = std::thread([this] { studio_->run(); });
  studio_->joined(kPainter);
  (void)wait_until([](const json& state) { return state["task"] == "train" && state["figures"].contains("psnr"); });
  const cv::Mat early = decoded(post("frame", frame({"grey"})));
  EXPECT_GT(early.cols, early.rows) << "as large as there is time for";
  EXPECT_EQ(post("orders", {{"order", "colour"}}).status, 409);
  EXPECT_EQ(put({stroke("a", 0.5, 0.5)}, 0).status, 200) << "painting need not wait";
  EXPECT_EQ(put_with({stroke_on("viewpoint-1")}, {viewpoint("viewpoint-1")}, 1).status, 200);
  const cv::Mat photo = decoded(get(address("photos/", 0)));
  EXPECT_GT(photo.cols, photo.rows) << "of the field as it is by now, as large as there is time for";
  EXPECT_EQ(get(address("reach/", 0)).status, 503);
  EXPECT_EQ(post("orders", {{"order", "stop"}}).status, 202);
  const json stopped = wait_until(test::is_idle);
  EXPECT_EQ(stopped["stage"], "training");
  EXPECT_EQ(post("frame", frame({"grey"})).status, 200) << "what was learned is shown";
  EXPECT_EQ(ordered({{"order", "colour"}})["failed"], true);

  context.config.stage1.max_seconds = 1e-3;  // it is long past that
  const json trained = ordered({{"order", "train"}});
  EXPECT_EQ(trained["stage"], "field") << trained;
  EXPECT_EQ(trained["scene"], stopped["scene"].get<int>() + 1);
  EXPECT_TRUE(trained["ready"]);
  EXPECT_EQ(ordered({{"order", "colour"}})["unkept"], true);
  EXPECT_EQ(ordered({{"order", "train"}})["failed"], true) << "it is";
  close();
}

TEST_F(StudioTest, ViewsWhoseTracingWasStoppedAreTracedByTheNextOrder) {
  studio_ = std::make_unique<Studio>(context_, "", cpu_engines(), observer_, kQuick);
  studio_->joined(kPainter);
  EXPECT_EQ(post("orders", {{"order", "stop"}}).status, 202);
  worker_ = std::thread([this] { studio_->run(); });
  const json stopped = wait_until(
      [](const json& state) { return test::is_idle(state) && !state["message"].get<std::string>().empty(); });
  EXPECT_EQ(stopped["ready"], false);
  EXPECT_EQ(put({stroke("a", 0.5, 0.5)}, 0).status, 200);
  EXPECT_EQ(ordered({{"order", "colour"}})["ready"], true);
  EXPECT_EQ(get("reach/1").status, 200);
}

TEST_F(StudioTest, AStopThatComesBeforeTheWorkBeginsStopsIt) {
  open();
  EXPECT_EQ(put({stroke("a", 0.5, 0.5)}, 0).status, 200);
  EXPECT_EQ(post("orders", {{"order", "colour"}}).status, 202);
  EXPECT_EQ(post("orders", {{"order", "stop"}}).status, 202);
  EXPECT_THAT(wait_until(test::is_idle)["message"].get<std::string>(), HasSubstr("stopped"));
}

TEST_F(StudioTest, StoppingKeepsWhatWasLearned) {
  open();
  EXPECT_EQ(put({stroke("a", 0.5, 0.5)}, 0).status, 200);
  EXPECT_EQ(post("orders", {{"order", "colour"}}).status, 202);
  (void)wait_until([](const json& state) { return state["task"] == "colour" && state["fraction"] > 0; });
  EXPECT_EQ(post("orders", {{"order", "begin"}, {"take", ""}}).status, 409);
  EXPECT_EQ(post("orders", {{"order", "stop"}}).status, 202);
  const json stopped = wait_until(test::is_idle);
  EXPECT_EQ(stopped["unkept"], true);
}

// ---- requests ----

TEST_F(StudioTest, ThumbnailsOfManyTabsAreAllDrawn) {
  open();
  std::vector<int> drawn(8, 0);
  std::vector<std::thread> tabs;
  for (int& count : drawn) {
    tabs.emplace_back([this, &count] {
      // As pictures of a page are asked for: without a client.
      for (int i = 0; i < 20; ++i) {
        count += studio_->answer({"GET", "/studio/thumbnails/1", {}, {}, {}, {}}).status == 200 ? 1 : 0;
      }
    });
  }
  for (std::thread& tab : tabs) tab.join();
  EXPECT_THAT(drawn, testing::Each(20));
}

TEST_F(StudioTest, ReferencesThatAreRefusedAreNotWritten) {
  Studio studio(context_, "", cpu_engines(), observer_, kQuick);  // its first work has not begun
  studio.joined(kPainter);
  const auto sent = [&](const std::string& client) {
    return studio.answer({"POST", "/studio/pictures", {{"kind", "reference"}}, client, {}, test::turned_photograph(6)});
  };
  EXPECT_EQ(sent(kPainter).status, 409);
  EXPECT_EQ(sent("another123").status, 423);
  EXPECT_FALSE(fs::exists(stroke_folder(context_) / "references"));
}

TEST_F(StudioTest, TakesThatCannotBeReadAreLeftOutAndTold) {
  write_file(context_.directory.take_record_file("later"), R"({"schema_version": 99})");
  open();
  const json opened = json::parse(get("state").body);
  EXPECT_EQ(opened["takes"].size(), 0u);
  EXPECT_THAT(opened["notes"].dump(), HasSubstr("later"));
  write_file(context_.directory.take_record_file("damaged"), "{");
  const json next = ordered({{"order", "begin"}, {"take", ""}});
  EXPECT_EQ(next["failed"], false) << next;
  EXPECT_EQ(next["takes"].size(), 0u);
  EXPECT_EQ(next["notes"].size(), 2u) << "each once: " << next;
  close();
  context_.directory.update([](pipeline::RunRecord& record) { record.current_take = "damaged"; });
  go_on();
  EXPECT_EQ(json::parse(get("state").body)["take"], "") << "the run can be opened still";
}

// ---- takes ----

std::vector<std::byte> colors_in_take(const pipeline::RunContext& context, const std::string& take) {
  return read_binary_file(context.directory.take_snapshot(take));
}

Journal journal_in_take(const pipeline::RunContext& context, const std::string& take) {
  return read_journal(context.directory.take_folder(take) / kJournalFile, paintable_views(context.capture));
}

/// What a replay makes of a take, in one of its own.
std::vector<std::byte> replayed_colors(const pipeline::RunContext& context, const std::string& take) {
  Observer observer;
  Coloring again(context, cpu_engines());
  again.replay(journal_in_take(context, take), kQuick, [](double) {});
  again.keep(take + "-again", 0, observer);
  return colors_in_take(context, take + "-again");
}

/// A view as it comes from a paint program: its left half is painted.
std::string half_painted_png(const View& view) {
  cv::Mat painted(view.image.height, view.image.width, CV_8UC4, cv::Scalar(0, 0, 0, 0));
  painted(cv::Rect(0, 0, painted.cols / 2, painted.rows)).setTo(cv::Scalar(20, 30, 200, 255));
  std::vector<std::uint8_t> png;
  cv::imencode(".png", painted, png);
  return {png.begin(), png.end()};
}

TEST_F(StudioTest, TakesOfPaintedPicturesAreReplayedWhateverWasDoneWithThem) {
  open();
  const PageAnswer sent =
      send_picture({{"kind", "stroke"}, {"view", "1"}}, half_painted_png(context_.capture.views[1]));
  ASSERT_EQ(sent.status, 202) << sent.body;
  (void)ordered({{"order", "colour"}});
  ASSERT_EQ(put({stroke("a", 0.5, 0.5)}, 1).status, 200) << "without the picture";
  (void)ordered({{"order", "colour"}});
  (void)ordered({{"order", "keep"}, {"name", "red"}});
  (void)ordered({{"order", "duplicate"}, {"take", "red"}, {"name", "copy"}});
  (void)ordered({{"order", "rename"}, {"take", "red"}, {"name", "evening"}});
  ASSERT_EQ(put({stroke("a", 0.5, 0.5), stroke("b", 0.3, 0.6)}, 2).status, 200);
  (void)ordered({{"order", "colour"}});
  const json written = ordered({{"order", "photographs"}, {"format", "png"}});
  EXPECT_EQ(written["failed"], false) << written;
  close();
  for (const char* take : {"copy", "evening", "studio"}) {
    EXPECT_TRUE(fs::exists(context_.directory.take_folder(take) / kStrokeFile)) << take;
    EXPECT_TRUE(replayed_colors(context_, take) == colors_in_take(context_, take)) << take;
  }
  fs::remove_all(context_.directory.root() / "renders");
}

TEST_F(StudioTest, ATakeThatAnotherWasBegunFromIsRenamedForBothAndNotDeleted) {
  open();
  ASSERT_EQ(put({stroke("a", 0.5, 0.5)}, 0).status, 200);
  (void)ordered({{"order", "colour"}});
  (void)ordered({{"order", "keep"}, {"name", "red"}});
  (void)ordered({{"order", "begin"}, {"take", "red"}});
  ASSERT_EQ(put({stroke("a", 0.5, 0.5), stroke("b", 0.3, 0.6)}, 1).status, 200);
  (void)ordered({{"order", "colour"}});
  (void)ordered({{"order", "keep"}, {"name", "blue"}});
  (void)ordered({{"order", "begin"}, {"take", ""}});
  const json refused = ordered({{"order", "delete"}, {"take", "red"}});
  EXPECT_EQ(refused["failed"], true);
  EXPECT_THAT(refused["message"].get<std::string>(), HasSubstr("blue"));
  EXPECT_EQ(refused["takes"].size(), 2u);
  EXPECT_EQ(ordered({{"order", "rename"}, {"take", "red"}, {"name", "evening"}})["failed"], false);
  close();
  EXPECT_EQ(journal_in_take(context_, "blue").deeds.front().base, "evening");
  EXPECT_TRUE(replayed_colors(context_, "blue") == colors_in_take(context_, "blue"));
  fs::copy_file(context_.directory.take_snapshot("blue"), context_.directory.take_snapshot("evening"),
                fs::copy_options::overwrite_existing);
  EXPECT_THROW((void)replayed_colors(context_, "blue"), SnapshotError) << "another take is called so now";
}

TEST_F(StudioTest, DeletingTheCurrentTakePassesTakesThatCannotBeRead) {
  open();
  ASSERT_EQ(put({stroke("a", 0.5, 0.5)}, 0).status, 200);
  (void)ordered({{"order", "colour"}});
  (void)ordered({{"order", "keep"}, {"name", "red"}});
  write_file(context_.directory.take_record_file("damaged"), "{");
  EXPECT_EQ(ordered({{"order", "delete"}, {"take", "red"}})["failed"], false);
  EXPECT_EQ(context_.directory.record().current_take, "");
}

TEST_F(StudioTest, ATakeThatIsCalledGreyIsNotGrey) {
  open();
  ASSERT_EQ(put({stroke_on(context_.capture.views[1].name)}, 0).status, 200);
  (void)ordered({{"order", "colour"}});
  (void)ordered({{"order", "keep"}, {"name", "red"}});
  close();
  fs::rename(context_.directory.take_folder("red"), context_.directory.take_folder("grey"));  // as commands name it
  open();
  const auto shown = [&](const std::string& side) { return colorfulness(decoded(post("frame", frame({side})))); };
  EXPECT_LT(shown(""), 2);
  EXPECT_GT(shown("grey"), 10);
  EXPECT_EQ(ordered({{"order", "begin"}, {"take", "grey"}})["take"], "grey");
  EXPECT_GT(shown("now"), 10);
  EXPECT_EQ(ordered({{"order", "begin"}, {"take", ""}})["take"], "");
  EXPECT_LT(shown("now"), 2);
}

TEST_F(StudioTest, CommandsAreQuotedAndSayWhatIsDoneAgain) {
  const test::TempDir folder;
  pipeline::RunContext context{pipeline::RunDirectory(folder / "my run"), context_.config, context_.capture, {}};
  context.config.bake.resolution = 32;
  const std::string run = folder / "my run", capture = folder / "capture";
  write_file(folder / "capture/prepare.json", R"({"source": "/my photos"})");
  pipeline::begin_run(context, capture, {});
  studio_ = std::make_unique<Studio>(context, "", cpu_engines(), observer_, kQuick);
  worker_ = std::thread([this] { studio_->run(); });
  studio_->joined(kPainter);
  const json trained = wait_until([](const json& state) { return state["ready"] == true && test::is_idle(state); });
  EXPECT_EQ(trained["commands"],
            json({"cnerf prepare '/my photos' -o " + capture,
                  "cnerf train " + capture + " -o '" + run + "' --config '" + run + "/config.toml'"}));

  const auto line_of = [&](const json& order) { return ordered(order)["commands"].back().get<std::string>(); };
  const std::string colorize = "cnerf colorize '" + run + "' ";
  EXPECT_EQ(put({stroke("a", 0.5, 0.5)}, 0).status, 200);
  EXPECT_EQ(line_of({{"order", "colour"}}),
            colorize + "--take painted --colorizer grey --strokes '" + run + "/strokes/strokes.json'");
  EXPECT_EQ(line_of({{"order", "keep"}, {"name", "red"}}), colorize + "--replay red");
  (void)ordered({{"order", "begin"}, {"take", "red"}});
  EXPECT_EQ(line_of({{"order", "colour"}}), colorize + "--replay red") << "its own line comes when it is kept";
  (void)ordered({{"order", "begin"}, {"take", ""}});
  const json baked = ordered({{"order", "bake"}, {"formats", {"vdb"}}});
  EXPECT_EQ(baked["commands"].back(), "cnerf bake '" + run + "' --take grey --format vdb");
  EXPECT_EQ(baked["blender"], "blender --python '" + run + "/bakes/grey/blender_setup.py'");
  close();
}

TEST_F(StudioTest, ColorsThatNoTakeHoldsAreMadeAgainWhenTheRunIsOpened) {
  const fs::path file = stroke_folder(context_) / kNowFile;
  const auto color_twice = [&] {
    open();
    const int revision = json::parse(get("strokes").body)["revision"];
    EXPECT_EQ(put({stroke("a", 0.5, 0.5)}, revision).status, 200);
    (void)ordered({{"order", "colour"}});
    EXPECT_EQ(put({stroke("a", 0.5, 0.5), stroke("b", 0.3, 0.6)}, revision + 1).status, 200);
    EXPECT_EQ(ordered({{"order", "colour"}})["unkept"], true);
    EXPECT_TRUE(fs::exists(file));
  };
  color_twice();
  (void)ordered({{"order", "keep"}, {"name", "red"}});
  EXPECT_FALSE(fs::exists(file)) << "a take holds them";
  close();
  color_twice();
  close();

  go_on(false);
  (void)wait_until([](const json& state) { return state["task"] == "recolour" && state["fraction"] > 0; });
  EXPECT_EQ(post("orders", {{"order", "stop"}}).status, 202);
  (void)wait_until(test::is_idle);
  close();
  EXPECT_TRUE(fs::exists(file)) << "they can still be made";
  open("red");
  EXPECT_EQ(json::parse(get("state").body)["unkept"], false) << "something else was asked for";
  (void)ordered({{"order", "begin"}, {"take", ""}});
  close();
  EXPECT_TRUE(fs::exists(file)) << "nobody saw them, so nobody left them";

  go_on(false);
  const json again = wait_until([](const json& state) { return state["unkept"] == true && test::is_idle(state); });
  EXPECT_EQ(again["take"], "") << "and not the current one, red";
  (void)ordered({{"order", "keep"}, {"name", "blue"}});
  EXPECT_FALSE(fs::exists(file));
  EXPECT_TRUE(colors_in_take(context_, "blue") == colors_in_take(context_, "red"));
}

TEST_F(StudioTest, ColorsThatNoTakeHoldsAreSetAsideBeforeOthersTakeTheirPlace) {
  const fs::path file = stroke_folder(context_) / kNowFile, aside = stroke_folder(context_) / "now-1.json";
  write_file(file, R"({"deeds": [{"base": "gone"}, {"steps": 1}]})");
  go_on();
  EXPECT_THAT(json::parse(get("state").body)["notes"].dump(), HasSubstr("now-1.json"));
  EXPECT_FALSE(fs::exists(file));
  EXPECT_TRUE(fs::exists(aside)) << "they cannot be made again";
  close();

  const std::string unseen = R"({"deeds": [{}, {"steps": 1}]})";
  write_file(file, unseen);
  open("");
  EXPECT_EQ(put({stroke("a", 0.5, 0.5)}, 0).status, 200);
  EXPECT_EQ(ordered({{"order", "colour"}})["failed"], false);
  EXPECT_EQ(read_text_file(stroke_folder(context_) / "now-2.json"), unseen) << "nobody saw them";
  EXPECT_EQ(read_journal(file, paintable_views(context_.capture)).deeds.size(), 2u);
}

TEST_F(StudioTest, ColorsOfAStopAndOfADeletedTakeAreMadeAgainToo) {
  const fs::path file = stroke_folder(context_) / kNowFile;
  const PaintableViews views = paintable_views(context_.capture);
  context_.directory.update([](pipeline::RunRecord& record) { record.current_take.clear(); });
  open();
  EXPECT_EQ(put({stroke("a", 0.5, 0.5)}, 0).status, 200);
  EXPECT_EQ(post("orders", {{"order", "colour"}}).status, 202);
  (void)wait_until([](const json& state) { return state["task"] == "colour" && state["fraction"] > 0; });
  EXPECT_EQ(post("orders", {{"order", "stop"}}).status, 202);
  EXPECT_EQ(wait_until(test::is_idle)["unkept"], true);
  const int steps = read_journal(file, views).deeds.back().steps;
  close();

  go_on(false);
  (void)wait_until([](const json& state) { return state["unkept"] == true && test::is_idle(state); });
  (void)ordered({{"order", "keep"}, {"name", "red"}});
  EXPECT_EQ(journal_in_take(context_, "red").deeds.back().steps, steps);
  EXPECT_EQ(ordered({{"order", "delete"}, {"take", "red"}})["unkept"], true);
  EXPECT_EQ(read_journal(file, views).deeds.back().steps, steps);
  (void)ordered({{"order", "begin"}, {"take", ""}});
  EXPECT_FALSE(fs::exists(file)) << "they were left";
}

TEST_F(StudioTest, OnlyWhatABakeWroteIsOffered) {
  pipeline::RunContext context = context_;
  context.config.bake.resolution = context.config.web.resolution = 32;
  studio_ = std::make_unique<Studio>(context, "", cpu_engines(), observer_, kQuick);
  worker_ = std::thread([this] { studio_->run(); });
  studio_->joined(kPainter);
  (void)wait_until([](const json& state) { return state["ready"] == true && test::is_idle(state); });
  EXPECT_EQ(ordered({{"order", "bake"}, {"formats", {"vdb"}}})["downloads"].size(), 1u);
  const json web = ordered({{"order", "bake"}, {"formats", {"web"}}});
  EXPECT_EQ(web["failed"], false) << web;
  EXPECT_EQ(web["downloads"].size(), 0u) << "the volume is of the bake before";
  close();
  fs::remove_all(context_.directory.root() / "bakes");
}

TEST_F(StudioTest, PaintOnViewsOfLikeNamesHasPicturesOfItsOwn) {
  const test::TempDir folder;
  Capture capture = context_.capture;
  capture.views[1].name = "left/1.png";
  capture.views[2].name = "left_1.png";
  const json painted = stroke_on("left/1.png");
  write_paint_pictures(folder.path(), capture, {record_of<Stroke>(parse_json(painted.dump(), "test"), "test")});
  EXPECT_TRUE(fs::exists(folder / "left_1.png")) << "the other view is unpainted";
}

}  // namespace
}  // namespace cnerf::studio
