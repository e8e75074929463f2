#include "src/capture/npy_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "src/base/error.h"
#include "src/base/files.h"
#include "tests/capture/fixtures.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

using test::bytes_of;
using testing::ElementsAre;
using testing::HasSubstr;

class Npy : public testing::Test {
 protected:
  test::TempDir folder_;
  std::filesystem::path file_ = folder_ / "a.npy";

  void expect_refused(const std::string& reason) {
    try {
      (void)read_npy(file_);
      FAIL() << "no error";
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("a.npy"), HasSubstr(reason)));
    }
  }
};

TEST_F(Npy, ReadsAllTypes) {
  test::write_npy(file_, "<f8", false, "3,", bytes_of<double>({0.5, -1, 1e300}));
  EXPECT_THAT(read_npy(file_).values, ElementsAre(0.5, -1, 1e300));
  test::write_npy(file_, "<f4", false, "2,", bytes_of<float>({0.5f, 3}));
  EXPECT_THAT(read_npy(file_).values, ElementsAre(0.5, 3));
  test::write_npy(file_, "<i8", false, "2,", bytes_of<std::int64_t>({-90, 5'000'000'000}));
  EXPECT_THAT(read_npy(file_).values, ElementsAre(-90, 5e9));
  test::write_npy(file_, "<i4", false, "2,", bytes_of<std::int32_t>({-90, 7}));
  EXPECT_THAT(read_npy(file_).values, ElementsAre(-90, 7));
}

TEST_F(Npy, ReadsAllVersions) {
  for (const int version : {1, 2, 3}) {
    test::write_npy(file_, "<f8", false, "1, 2", bytes_of<double>({1, 2}), version);
    const NpyArray array = read_npy(file_);
    EXPECT_THAT(array.shape, ElementsAre(1, 2));
    EXPECT_THAT(array.values, ElementsAre(1, 2));
  }
}

TEST_F(Npy, FortranOrderIsTurnedIntoC) {
  // [[0, 1, 2], [3, 4, 5]] column by column.
  test::write_npy(file_, "<f8", true, "2, 3", bytes_of<double>({0, 3, 1, 4, 2, 5}));
  EXPECT_THAT(read_npy(file_).values, ElementsAre(0, 1, 2, 3, 4, 5));
}

TEST_F(Npy, FortranOrderOfThreeAxes) {
  // a[i][j][k] = 100 i + 10 j + k, first index fastest, shape 2 x 1 x 3.
  test::write_npy(file_, "<f8", true, "2, 1, 3", bytes_of<double>({0, 100, 1, 101, 2, 102}));
  EXPECT_THAT(read_npy(file_).values, ElementsAre(0, 1, 2, 100, 101, 102));
}

TEST_F(Npy, ScalarHasAnEmptyShape) {
  test::write_npy(file_, "<f8", false, "", bytes_of<double>({4}));
  EXPECT_THAT(read_npy(file_).shape, ElementsAre());
  EXPECT_THAT(read_npy(file_).values, ElementsAre(4));
}

TEST_F(Npy, OtherTypesAreNamed) {
  test::write_npy(file_, ">f8", false, "1,", bytes_of<double>({1}));
  expect_refused(">f8");
  test::write_npy(file_, "|O", false, "1,", bytes_of<double>({1}));
  expect_refused("|O");
}

TEST_F(Npy, TruncatedFilesAreRefusedWhereverTheyEnd) {
  test::write_npy(file_, "<f8", false, "40,", bytes_of(std::vector<double>(40, 1.0)));
  for (const double share : {0.97, 0.5, 0.15, 0.02, 0.0}) {
    test::truncate_file(file_, share);
    EXPECT_THROW((void)read_npy(file_), InputError) << share;
  }
}

TEST_F(Npy, SenselessShapesDoNotOverflow) {
  test::write_npy(file_, "<f8", false, "999999999999, 999999999999, 999999999999", bytes_of<double>({1}));
  expect_refused("cut short");
  test::write_npy(file_, "<f8", false, "99999999999999999999999", bytes_of<double>({1}));
  expect_refused("shape");
}

TEST_F(Npy, LongHeadersAreRefused) {
  for (const char letter : {' ', 'x', '1', '\''}) {
    const std::string padding(60'000, letter);
    test::write_npy(file_, "<f8" + padding, false, "1,", bytes_of<double>({1}));
    expect_refused("at most 10000 bytes");
  }
}

TEST_F(Npy, HeadersWithoutWhatIsNeededAreRefused) {
  for (const std::string key : {"descr", "fortran_order", "shape"}) {
    test::write_npy(file_, "<f8", false, "1,", bytes_of<double>({1}));
    std::string content = read_text_file(file_);
    write_file(file_, content.replace(content.find("'" + key + "'") + 1, 1, "_"));
    expect_refused(key + ": expected in the header");
  }
}

TEST_F(Npy, OtherFilesAreRefused) {
  write_file(file_, "this is a text file of some length");
  expect_refused("expected a NumPy .npy file");
  EXPECT_THROW((void)read_npy(folder_ / "none.npy"), MissingInputError);
}

}  // namespace
}  // namespace cnerf
