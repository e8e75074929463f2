#include "src/capture/photograph_store.h"

#include <gtest/gtest.h>

#include <chrono>
#include <fstream>
#include <numeric>
#include <thread>

#include "src/base/error.h"
#include "src/capture/black_background.h"
#include "src/capture/load_capture.h"
#include "tests/capture/fixtures.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

MonoImage image_of(int width, int height) {
  MonoImage image;
  image.width = width;
  image.height = height;
  image.u8.resize(image.pixel_count());
  for (std::size_t i = 0; i < image.pixel_count(); ++i) image.u8[i] = std::uint8_t(i * 7 + i / 251);
  image.alpha.assign(image.pixel_count(), 200);
  return image;
}

TEST(PhotographStore, WhatFitsStaysInMemory) {
  const test::TempDir folder;
  MonoImage image = image_of(64, 32);
  PhotographStore store({bytes_of(image), folder.path()});
  store.take(image);
  EXPECT_FALSE(store.has_file());
  EXPECT_FALSE(image.u8.is_in_file());
}

TEST(PhotographStore, WhatDoesNotFitIsReadFromAFileWithoutAName) {
  const test::TempDir folder;
  const MonoImage given = image_of(301, 67);  // no whole pages
  MonoImage first = given, second = given;
  {
    PhotographStore store({bytes_of(given), folder.path()});
    store.take(first);
    store.take(second);
    ASSERT_TRUE(store.has_file());
    EXPECT_FALSE(first.u8.is_in_file());
    store.put(first);
    EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
  }
  // Images outlive the store, and so do their copies.
  for (const MonoImage& image : {first, second, MonoImage(second)}) {
    EXPECT_TRUE(image.u8.is_in_file());
    EXPECT_EQ(image.u8, given.u8);
    EXPECT_EQ(image.alpha, given.alpha);
    EXPECT_TRUE(image.mask.empty());
    EXPECT_EQ(luminance_plane(image), luminance_plane(given));
  }
}

TEST(PhotographStore, WhereTooMuchIsExpectedNothingStaysInMemory) {
  const test::TempDir folder;
  const MonoImage given = image_of(64, 64);
  PhotographStore store({2 * bytes_of(given), folder.path()}, 3 * bytes_of(given));
  MonoImage first = given;
  store.take(first);
  EXPECT_TRUE(first.u8.is_in_file());
  EXPECT_EQ(first.u8, given.u8);
}

TEST(PhotographStore, PixelsOfAFileAreWrittenToInMemoryOnly) {
  const test::TempDir folder;
  MonoImage image = image_of(16, 16);
  PhotographStore store({0, folder.path()});
  store.take(image);
  EXPECT_THROW(image.u8[0] = 1, ContractError);
  EXPECT_THROW(image.u8.push_back(1), ContractError);
  const MonoImage kept = image;
  image.u8.bring_to_memory();
  image.u8[0] = std::uint8_t(kept.u8[0] + 1);
  EXPECT_NE(image.u8[0], kept.u8[0]);
}

TEST(PhotographStore, WithoutRoomItSaysWhichOptionAsksForIt) {
  MonoImage image = image_of(16, 16);
  PhotographStore store({0, "/nowhere"});
  try {
    store.take(image);
    FAIL() << "taken";
  } catch (const OutputError& refused) {
    EXPECT_NE(std::string(refused.what()).find("--image-memory"), std::string::npos) << refused.what();
  }
}

std::size_t held_pages_of_files() {
  std::size_t size = 0, resident = 0, of_files = 0;
  std::ifstream("/proc/self/statm") >> size >> resident >> of_files;
  return of_files * 4096;
}

TEST(PhotographStore, WhatWasTouchedIsLetGoAgain) {
  const test::TempDir folder;
  const std::size_t before = held_pages_of_files();
  MonoImage image = image_of(8192, 8192);  // 128 MiB with its alpha
  constexpr std::size_t kMemory = std::size_t(8) << 20;
  PhotographStore store({kMemory, folder.path()});
  store.take(image);
  const auto touch = [](const PixelPlane<std::uint8_t>& plane) {
    std::size_t sum = 0;
    for (std::size_t i = 0; i < plane.size(); i += 4096) sum += plane[i];
    return sum;
  };
  EXPECT_GT(touch(image.u8) + touch(image.alpha), 0u);
  std::size_t held = held_pages_of_files();
  for (int look = 0; look < 100 && held > before + 2 * kMemory; ++look) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    held = held_pages_of_files();
  }
  EXPECT_LE(held, before + 2 * kMemory);
  EXPECT_EQ(touch(image.alpha), image.alpha.size() / 4096 * 200);
}

/// The same capture with and without room for it: transparent pixels are masked after reading, in the file too.
TEST(PhotographStore, ACaptureDoesNotDependOnItsMemory) {
  const test::TempDir folder;
  test::write_json(folder.path() / "transforms.json", test::write_transforms(folder.path(), 5));
  const Capture roomy = load_capture(folder.path());
  const Capture narrow = load_capture(folder.path(), {}, {2 * bytes_of(roomy.views[0].image), folder.path()});
  ASSERT_EQ(narrow.views.size(), roomy.views.size());
  for (std::size_t v = 0; v < roomy.views.size(); ++v) {
    EXPECT_TRUE(narrow.views[v].image.u8.is_in_file()) << v;
    EXPECT_FALSE(roomy.views[v].image.u8.is_in_file()) << v;
    EXPECT_EQ(narrow.views[v].image.u8, roomy.views[v].image.u8);
    EXPECT_EQ(narrow.views[v].image.mask, roomy.views[v].image.mask);
  }
}

TEST(PhotographStore, ObjectsBeforeBlackAreCutOutOfItsFile) {
  const test::TempDir folder;
  std::vector<View> views(2);
  for (View& view : views) {
    view.image.width = view.image.height = 128;
    view.image.u8.assign(128 * 128, 0);
    for (int y = 40; y < 90; ++y) {
      for (int x = 40; x < 90; ++x) view.image.u8[std::size_t(y * 128 + x)] = 180;
    }
  }
  std::vector<View> in_file = views;
  PhotographStore store({0, folder.path()});
  for (View& view : in_file) store.take(view.image);
  ASSERT_TRUE(cut_out_of_black(views));
  ASSERT_TRUE(cut_out_of_black(in_file, [&](MonoImage& image) { store.put(image); }));
  for (std::size_t v = 0; v < views.size(); ++v) {
    EXPECT_TRUE(in_file[v].image.alpha.is_in_file());
    EXPECT_EQ(in_file[v].image.u8, views[v].image.u8);
    EXPECT_EQ(in_file[v].image.alpha, views[v].image.alpha);
  }
}

}  // namespace
}  // namespace cnerf
