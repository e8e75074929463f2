// Frames: the latest camera of a client wins, others are not disturbed.

#include "src/studio/frame_desk.h"

#include <gtest/gtest.h>

#include <future>
#include <latch>
#include <stdexcept>

namespace cnerf::studio {
namespace {

FrameDesk::Drawing text(const std::string& text) {
  return [text](const auto&) { return std::optional(text); };
}

TEST(FrameDesk, DrawsWhatIsAskedFor) {
  std::latch asked(2);
  FrameDesk desk([&] { asked.count_down(); });
  auto one = std::async(std::launch::async, [&] { return desk.ask("one", false, text("1")); });
  auto two = std::async(std::launch::async, [&] { return desk.ask("two", false, text("2")); });
  asked.wait();
  EXPECT_TRUE(desk.has_waiting());
  EXPECT_TRUE(desk.draw_waiting());
  EXPECT_EQ(one.get(), "1");
  EXPECT_EQ(two.get(), "2");
  EXPECT_FALSE(desk.draw_waiting());
}

TEST(FrameDesk, UrgentFramesCanBeDrawnAlone) {
  std::latch asked(2);
  FrameDesk desk([&] { asked.count_down(); });
  auto moving = std::async(std::launch::async, [&] { return desk.ask("one", true, text("1")); });
  auto resting = std::async(std::launch::async, [&] { return desk.ask("two", false, text("2")); });
  asked.wait();
  EXPECT_TRUE(desk.draw_waiting(FrameDesk::Which::kUrgent));
  EXPECT_EQ(moving.get(), "1");
  EXPECT_FALSE(desk.has_waiting(FrameDesk::Which::kUrgent));
  EXPECT_FALSE(desk.draw_waiting(FrameDesk::Which::kUrgent));
  EXPECT_TRUE(desk.has_waiting());
  EXPECT_TRUE(desk.draw_waiting());
  EXPECT_EQ(resting.get(), "2");
}

TEST(FrameDesk, AnOlderFrameThatWaitsIsLetGo) {
  std::latch first_asked(1), second_asked(2);
  FrameDesk desk([&] {
    first_asked.try_wait() ? second_asked.count_down() : first_asked.count_down();
    if (!second_asked.try_wait()) second_asked.count_down();
  });
  auto older = std::async(std::launch::async, [&] { return desk.ask("one", false, text("old")); });
  first_asked.wait();
  auto newer = std::async(std::launch::async, [&] { return desk.ask("one", false, text("new")); });
  EXPECT_EQ(older.get(), std::nullopt) << "without anybody drawing";
  second_asked.wait();
  desk.draw_waiting();
  EXPECT_EQ(newer.get(), "new");
}

TEST(FrameDesk, AFrameThatIsBeingDrawnStopsWhenItsClientWantsAnother) {
  std::latch drawing(1);
  FrameDesk desk([] {});
  auto older = std::async(std::launch::async, [&] {
    return desk.ask("one", false, [&](const std::function<bool()>& keep_going) -> std::optional<std::string> {
      drawing.count_down();
      while (keep_going()) std::this_thread::yield();
      return std::nullopt;
    });
  });
  auto worker = std::async(std::launch::async, [&] {
    while (!desk.draw_waiting()) std::this_thread::yield();
  });
  drawing.wait();
  auto newer = std::async(std::launch::async, [&] { return desk.ask("one", false, text("new")); });
  EXPECT_EQ(older.get(), std::nullopt);
  worker.get();
  desk.draw_waiting();
  EXPECT_EQ(newer.get(), "new");
}

TEST(FrameDesk, WhatDrawingThrowsReachesWhoAsked) {
  std::latch asked(1);
  FrameDesk desk([&] { asked.count_down(); });
  auto bad = std::async(std::launch::async, [&] {
    return desk.ask("one", false,
                    [](const auto&) -> std::optional<std::string> { throw std::runtime_error("no such take"); });
  });
  asked.wait();
  desk.draw_waiting();
  EXPECT_THROW(bad.get(), std::runtime_error);
}

TEST(FrameDesk, ClosingLetsEverybodyGo) {
  std::latch asked(1);
  FrameDesk desk([&] { asked.count_down(); });
  auto waiting = std::async(std::launch::async, [&] { return desk.ask("one", false, text("1")); });
  asked.wait();
  desk.close();
  EXPECT_EQ(waiting.get(), std::nullopt);
  EXPECT_EQ(desk.ask("two", false, text("2")), std::nullopt);
}

}  // namespace
}  // namespace cnerf::studio
