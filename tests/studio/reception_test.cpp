// Where a studio begins without a scene, by its answers.

#include "src/studio/reception.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <thread>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/sample/sample_scene.h"
#include "tests/studio/state.h"
#include "tests/support/data.h"
#include "tests/support/full_disk.h"
#include "tests/support/tiny_config.h"

namespace cnerf::studio {
namespace {
namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;
using web::PageAnswer;
constexpr const char* kSender = "painter123";

class ReceptionTest : public testing::Test {
 protected:
  void open(const fs::path& source = {}) {
    const auto begin = [this](const fs::path& capture, Observer& observer) {
      const Config config = test::tiny_config();
      pipeline::RunContext context{
          pipeline::RunDirectory(folder_ / "run"), config, pipeline::read_capture(capture, config, observer), {}};
      pipeline::begin_run(context, capture, {});
      return context;
    };
    reception_ = std::make_unique<Reception>(source, folder_ / "run", begin, observer_);
    reception_->joined(kSender);
    worker_ = std::thread([this] { context_ = reception_->run(); });
  }
  void TearDown() override {
    if (!reception_) return;
    reception_->close();
    if (worker_.joinable()) worker_.join();
  }
  PageAnswer put(const std::string& name, const std::string& offset, const std::string& body,
                 const std::string& client = kSender) {
    return reception_->answer({"PUT", "/studio/arrivals", {{"name", name}, {"offset", offset}}, client, {}, body});
  }
  PageAnswer order(const std::string& name) {
    return reception_->answer({"POST", "/studio/orders", {}, kSender, {}, json{{"order", name}}.dump()});
  }
  json state() { return json::parse(reception_->answer({"GET", "/studio/state", {}, kSender, {}, {}}).body); }
  json wait_until(const std::function<bool(const json&)>& holds) { return test::wait_until(*reception_, holds); }

  test::TempDir folder_;
  Observer observer_;
  std::unique_ptr<Reception> reception_;
  std::optional<pipeline::RunContext> context_;
  std::thread worker_;
};

TEST_F(ReceptionTest, FilesArriveInPieces) {
  open();
  EXPECT_EQ(json::parse(put("trip/a b.JPG", "0", "1234").body)["bytes"], 4);
  EXPECT_EQ(json::parse(put("trip/a b.JPG", "4", "56").body)["bytes"], 6);
  EXPECT_EQ(put("trip/a b.JPG", "4", "56").status, 409) << "the file does not end there";
  EXPECT_EQ(read_text_file(folder_ / "run-photographs/trip/a b.JPG"), "123456");
  EXPECT_EQ(state()["arrived"], (json{{"files", 1}, {"bytes", 6}, {"source", ""}}));
  EXPECT_EQ(put("trip/a b.JPG", "0", "9").status, 200) << "begins anew";
  EXPECT_EQ(state()["arrived"], (json{{"files", 1}, {"bytes", 1}, {"source", ""}}));
  EXPECT_EQ(put("b.png", "0", "x", "another1").status, 423);
  EXPECT_EQ(order("clear").status, 202);
  EXPECT_FALSE(fs::exists(folder_ / "run-photographs"));
  EXPECT_EQ(state()["arrived"]["files"], 0);
  EXPECT_EQ(json::parse(reception_->answer({"GET", "/studio/scene", {}, kSender, {}, {}}).body)["views"].size(), 0u);
}

TEST_F(ReceptionTest, AFullDiskIsToldAndThePieceCanBeSentAgain) {
  open();
  ASSERT_EQ(put("a.jpg", "0", "1234").status, 200);
  {
    const test::FullDisk full(6);
    EXPECT_EQ(put("a.jpg", "4", "5678").status, 507);
    EXPECT_EQ(state()["arrived"]["bytes"], 4);
    EXPECT_EQ(put("b.jpg", "0", "12345678").status, 507);
    EXPECT_EQ(state()["arrived"]["files"], 1);
  }
  EXPECT_EQ(read_text_file(folder_ / "run-photographs/a.jpg"), "1234");
  EXPECT_FALSE(fs::exists(folder_ / "run-photographs/b.jpg"));
  EXPECT_EQ(put("a.jpg", "4", "5678").status, 200);
  EXPECT_EQ(put("b.jpg", "0", "12345678").status, 200);
  EXPECT_EQ(state()["arrived"], (json{{"files", 2}, {"bytes", 16}, {"source", ""}}));
}

TEST_F(ReceptionTest, NamesThatLeadElsewhereAreRefusedByName) {
  open();
  const std::string nul("a\0.png", 6);
  for (const std::string& name :
       std::vector<std::string>{"", "../a.png", "a/../../b.png", "/etc/a.png", "a//b.png", "a/./b.png", ".a.png",
                                "a/.hidden/b.png", "a.exe", "png", "a\\b.png", "a\xff.png", "a\nb.png", nul,
                                std::string(201, 'a') + ".png", "1/2/3/4/5/6/a.png", "a.png/"}) {
    EXPECT_EQ(put(name, "0", "x").status, 400) << name;
  }
  EXPECT_THAT(put("virus.exe", "0", "x").body, HasSubstr("virus.exe"));
  for (const char* offset : {"", "-1", "x", "99999999999999999999", "17179869185", "18446744073709551615"}) {
    EXPECT_EQ(put("a.png", offset, "x").status, 400) << offset;
  }
  EXPECT_FALSE(fs::exists(folder_ / "run-photographs")) << "nothing was written";
  EXPECT_EQ(reception_->largest_body("PUT", "/studio/arrivals"), kLargestPiece);
  EXPECT_EQ(order("colour").status, 400);
}

TEST_F(ReceptionTest, APieceOfAFileThatWasNotBegunWritesNothing) {
  open();
  EXPECT_EQ(put("trip/a.jpg", "5", "x").status, 409);
  EXPECT_FALSE(fs::exists(folder_ / "run-photographs"));
  EXPECT_EQ(put("trip/a.jpg", "0", "x").status, 200);
  EXPECT_EQ(state()["arrived"], (json{{"files", 1}, {"bytes", 1}, {"source", ""}}));
}

TEST_F(ReceptionTest, FilesThatNoPageSentAreNeitherReplacedNorRemoved) {
  const fs::path own = folder_ / "run-photographs/mine.jpg";
  write_file(own, "mine");
  EXPECT_THROW(open(), UsageError);
  EXPECT_EQ(read_text_file(own), "mine");
  fs::remove(own);
  open();
  write_file(own, "mine");
  EXPECT_THAT(put("mine.jpg", "0", "sent").body, HasSubstr("run-photographs"));
  EXPECT_EQ(order("clear").status, 400);
  EXPECT_EQ(read_text_file(own), "mine");
}

TEST_F(ReceptionTest, FilesThatNoPageSentAreNoHindranceWhereASourceIsNamed) {
  const fs::path own = folder_ / "run-photographs/mine.jpg";
  write_file(own, "mine");
  fs::create_directories(folder_ / "empty");
  open(folder_ / "empty");
  (void)wait_until([](const json& now) { return now["failed"] == true; });
  EXPECT_THAT(put("mine.jpg", "0", "sent").body, HasSubstr("run-photographs"));
  EXPECT_EQ(read_text_file(own), "mine");
}

TEST_F(ReceptionTest, WhatArrivedInAnEarlierCallIsThereAndCanBeForgotten) {
  open();
  EXPECT_EQ(put("a.jpg", "0", "1234").status, 200);
  reception_->close();
  worker_.join();
  open();
  EXPECT_EQ(state()["arrived"], (json{{"files", 1}, {"bytes", 4}, {"source", ""}}));
  EXPECT_EQ(order("clear").status, 202);
  EXPECT_FALSE(fs::exists(folder_ / "run-photographs"));
}

TEST_F(ReceptionTest, WhatIsGoneWhenItIsPreparedIsToldAndOthersCanBeSent) {
  open();
  EXPECT_EQ(put("a.jpg", "0", "1234").status, 200);
  fs::remove_all(folder_ / "run-photographs");
  EXPECT_EQ(order("prepare").status, 202);
  const json state = wait_until([](const json& now) { return now["failed"] == true; });
  EXPECT_THAT(state["message"].get<std::string>(), HasSubstr("run-photographs: No such file"));
  EXPECT_EQ(put("b.jpg", "0", "1234").status, 200);
  EXPECT_EQ(this->state()["arrived"], (json{{"files", 1}, {"bytes", 4}, {"source", ""}})) << "the other one is gone";
  EXPECT_EQ(order("clear").status, 202);
  EXPECT_EQ(this->state()["failed"], false) << "nothing has failed yet";
}

TEST_F(ReceptionTest, WhatCannotBePreparedIsToldAndOthersCanBeSent) {
  open();
  EXPECT_EQ(order("prepare").status, 202);
  const json empty = wait_until([](const json& now) { return now["failed"] == true; });
  EXPECT_THAT(empty["message"].get<std::string>(), HasSubstr("nothing has arrived"));
  EXPECT_TRUE(test::is_idle(empty)) << "whoever hears of a failure may send more at once";
  EXPECT_EQ(put("a.jpg", "0", "no photograph").status, 200);
  EXPECT_EQ(order("prepare").status, 202);
  const json state = wait_until([](const json& now) { return now["failed"] == true; });
  EXPECT_THAT(state["message"].get<std::string>(), HasSubstr("a.jpg"));
  EXPECT_EQ(put("b.jpg", "0", "another").status, 200);
}

TEST_F(ReceptionTest, ACaptureThatArrivesWholeIsTakenAsItIs) {
  write_sample_scene(folder_ / "sent", {.views = 4, .width = 48, .height = 36, .samples_per_pixel = 1});
  open();
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "sent")) {
    if (!entry.is_regular_file()) continue;
    const std::string name = "sent/" + fs::relative(entry.path(), folder_ / "sent").string();
    (void)put(name, "0", read_text_file(entry.path()));
  }
  EXPECT_EQ(order("prepare").status, 202);
  worker_.join();
  ASSERT_TRUE(context_);
  EXPECT_EQ(context_->capture.views.size(), 4u);
  EXPECT_EQ(context_->directory.record().capture, folder_ / "run-photographs/sent");
}

TEST_F(ReceptionTest, ASourceOfTheCommandLineIsBegunWithAtOnce) {
  write_sample_scene(folder_ / "capture", {.views = 4, .width = 48, .height = 36, .samples_per_pixel = 1});
  open(folder_ / "capture");
  worker_.join();
  ASSERT_TRUE(context_);
  EXPECT_EQ(context_->capture.root, folder_ / "capture");
}

TEST_F(ReceptionTest, ASourceOfTheCommandLineComesBeforeWhatArrivedLongAgo) {
  write_sample_scene(folder_ / "capture", {.views = 4, .width = 48, .height = 36, .samples_per_pixel = 1});
  write_file(folder_ / "run-photographs/.cnerf-arrivals", "");
  write_sample_scene(folder_ / "run-photographs/old", {.views = 5, .width = 48, .height = 36, .samples_per_pixel = 1});
  open(folder_ / "capture");
  worker_.join();
  ASSERT_TRUE(context_);
  EXPECT_EQ(context_->capture.root, folder_ / "capture");
}

TEST_F(ReceptionTest, WhatArrivesTakesThePlaceOfASourceOfTheCommandLine) {
  for (const char* name : {"a.jpg", "b.jpg"}) write_file(folder_ / "photos" / name, "no photograph");
  write_file(folder_ / "run-photographs/.cnerf-arrivals", "");
  write_file(folder_ / "run-photographs/old.jpg", "of an earlier call");
  const std::string source = folder_ / "photos", sent = folder_ / "run-photographs";
  const auto failed = [](const json& now) { return now["failed"] == true; };
  open(source);
  const json first = wait_until(failed);
  EXPECT_THAT(first["message"].get<std::string>(), HasSubstr(source));
  EXPECT_EQ(first["arrived"], (json{{"files", 0}, {"bytes", 0}, {"source", source}}));

  EXPECT_EQ(put("c.jpg", "0", "no photograph").status, 200);
  EXPECT_EQ(state()["arrived"]["files"], 2) << "what came earlier is prepared too";
  EXPECT_THAT(state()["notes"].dump(), HasSubstr("instead of " + source));
  EXPECT_EQ(order("prepare").status, 202);
  const json second = wait_until(failed);
  EXPECT_THAT(second["message"].get<std::string>(), HasSubstr(sent));
  EXPECT_THAT(second["notes"].dump(), HasSubstr("instead of " + source));

  EXPECT_EQ(order("clear").status, 202);
  EXPECT_EQ(state()["notes"].size(), 0u);
  EXPECT_EQ(order("prepare").status, 202);
  const json third = wait_until(failed);
  EXPECT_THAT(third["message"].get<std::string>(), HasSubstr(source));
  EXPECT_THAT(third["notes"].dump(), testing::Not(HasSubstr("instead")));
}

TEST_F(ReceptionTest, AStopThatComesBeforeTheWorkBeginsStopsIt) {
  write_sample_scene(folder_ / "sent", {.views = 4, .width = 48, .height = 36, .samples_per_pixel = 1});
  open();
  for (const auto& entry : fs::directory_iterator(folder_ / "sent/images")) {
    EXPECT_EQ(put(entry.path().filename().string(), "0", read_text_file(entry.path())).status, 200);
  }
  EXPECT_EQ(order("prepare").status, 202);
  EXPECT_EQ(order("stop").status, 202);
  const json state =
      wait_until([](const json& now) { return test::is_idle(now) && !now["message"].get<std::string>().empty(); });
  EXPECT_EQ(state["message"], "stopped");
}

TEST_F(ReceptionTest, WhatWasPreparedOfOthersIsMadeAnew) {
  write_file(folder_ / "run-capture" / "work/source.txt", "/of/another\n");
  write_file(folder_ / "run-capture/transforms.json", "{}");
  fs::create_directories(folder_ / "photos");
  for (const char* name : {"a.jpg", "b.jpg"}) write_file(folder_ / "photos" / name, "no photograph");
  open(folder_ / "photos");
  const json state = wait_until([](const json& now) { return now["failed"] == true; });
  EXPECT_THAT(state["message"].get<std::string>(), HasSubstr("at least 2 that can be read"));
}

TEST(Board, ErrorsOfEveryKindAreSetbacks) {
  const auto gone = setback_of([] { (void)fs::file_size("/nowhere/at all"); }, "stopped");
  ASSERT_TRUE(gone);
  EXPECT_TRUE(gone->failed);
  EXPECT_EQ(gone->message, "/nowhere/at all: No such file or directory");
  const auto broken = setback_of([] { throw std::runtime_error("of a library"); }, "stopped");
  ASSERT_TRUE(broken);
  EXPECT_TRUE(broken->failed);
  EXPECT_THAT(broken->message, HasSubstr("of a library"));
}

TEST(Board, NamesThatAreNoTextAreToldAsFarAsTheyAre) {
  Board board;
  board.note("left out: caf\xe9.jpg");
  EXPECT_THAT(json::parse(board.text())["notes"].dump(), HasSubstr("left out: caf"));
  EXPECT_TRUE(board.wait_for_news(0, 1));
}

}  // namespace
}  // namespace cnerf::studio
