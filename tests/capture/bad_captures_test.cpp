/// Captures that cannot be used, and what the user is told: which file, which field, what is wrong with it.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/capture/load_capture.h"
#include "tests/capture/fixtures.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;

struct BadCapture {
  std::string name;
  std::function<void(const fs::path&)> make;
  ExitCode code;
  std::vector<std::string> says;  ///< parts of the message
};
void PrintTo(const BadCapture& bad, std::ostream* out) {
  *out << bad.name;
}

/// A good transforms.json, spoiled.
std::function<void(const fs::path&)> spoiled_json(std::function<void(json&)> spoil) {
  return [spoil = std::move(spoil)](const fs::path& folder) {
    json top = test::write_transforms(folder);
    spoil(top);
    test::write_json(folder / "transforms.json", top);
  };
}
/// A good capture of some kind, one file of which is then spoiled.
std::function<void(const fs::path&)> transforms_then(std::function<void(const fs::path&)> spoil) {
  return [spoil = std::move(spoil)](const fs::path& folder) {
    (void)test::write_transforms(folder);
    spoil(folder);
  };
}
std::function<void(const fs::path&)> colmap_then(std::function<void(const fs::path&)> spoil, bool text = false) {
  return [spoil = std::move(spoil), text](const fs::path& folder) {
    test::write_colmap_images(folder / "images");
    if (text) test::write_colmap_text(folder / "sparse");
    if (!text) test::write_colmap_binary(folder / "sparse");
    spoil(folder / "sparse");
  };
}
std::function<void(const fs::path&)> llff_then(std::function<void(const fs::path&)> spoil) {
  return [spoil = std::move(spoil)](const fs::path& folder) {
    test::write_llff(folder);
    spoil(folder);
  };
}
std::function<void(const fs::path&)> truncated(const std::string& file, double share) {
  return [=](const fs::path& folder) { test::truncate_file(folder / file, share); };
}
/// A good capture whose images all have one mask, which is of one code.
std::function<void(const fs::path&)> masked_by(int code) {
  return transforms_then([code](const fs::path& folder) {
    json top = json::parse(read_text_file(folder / "transforms.json"));
    cv::imwrite(folder / "mask.png", cv::Mat(test::kHeight, test::kWidth, CV_8UC1, cv::Scalar(code)));
    for (json& frame : top["frames"]) frame["mask_path"] = "mask.png";
    test::write_json(folder / "transforms.json", top);
  });
}
void replace_in(const fs::path& file, const std::string& from, const std::string& to) {
  std::string text = read_text_file(file);
  const std::size_t at = text.find(from);
  ASSERT_NE(at, std::string::npos) << from;
  write_file(file, text.replace(at, from.size(), to));
}
void write_llff_rows(const fs::path& folder, const std::vector<double>& rows, const std::string& shape) {
  test::write_npy(folder / "poses_bounds.npy", "<f8", false, shape, test::bytes_of(rows));
}

std::vector<BadCapture> bad_captures() {
  constexpr auto kInput = ExitCode::kInput;
  constexpr auto kMissing = ExitCode::kMissingInput;
  return {
      {"missing_folder", [](const fs::path& folder) { fs::remove_all(folder); }, kMissing, {"no such"}},
      {"empty_folder",
       [](const fs::path&) {},
       kMissing,
       {"empty", "transforms.json", "transforms_train.json", "cameras.bin", "cameras.txt", "poses_bounds.npy"}},
      {"images_without_poses",
       [](const fs::path& folder) { test::write_grey_image(folder / "images/0.png"); },
       kMissing,
       {"no poses", "transforms.json", "cameras.bin", "poses_bounds.npy"}},

      {"one_view",
       spoiled_json([](json& top) { top["frames"] = json::array({top["frames"][0]}); }),
       kInput,
       {"transforms.json", "at least 2", "found 1"}},
      {"no_view", spoiled_json([](json& top) { top["frames"] = json::array(); }), kInput, {"found 0"}},
      {"all_images_absent",
       transforms_then([](const fs::path& folder) { fs::remove_all(folder / "images"); }),
       kInput,
       {"found 0 (of 4 listed)"}},
      {"everything_held_out",
       spoiled_json([](json& top) {
         top["test_filenames"] = {"images/0.png", "images/1.png", "images/2.png"};
       }),
       kInput,
       {"split", "leaves 1 of 4"}},
      {"split_of_no_frame",
       spoiled_json([](json& top) {
         top["test_filenames"] = {"./images/0.png", "images/00.png"};
       }),
       kInput,
       {"transforms.json", "test_filenames", "names of frames", "images/00.png"}},

      {"json_syntax",
       transforms_then([](const fs::path& folder) { truncated("transforms.json", 0.7)(folder); }),
       kInput,
       {"transforms.json", "expected JSON", "line"}},
      {"json_too_deep",
       transforms_then([](const fs::path& folder) {
         replace_in(folder / "transforms.json", "{",
                    "{\"x\": " + std::string(200'000, '[') + std::string(200'000, ']') + ",");
       }),
       kInput,
       {"transforms.json", "at most 64 levels"}},
      {"json_long_value",
       spoiled_json([](json& top) { top["fl_x"] = std::string(100'000, 'x'); }),
       kInput,
       {"fl_x", "expected a number", "xxx…"}},
      {"exposure_of_no_photograph",
       spoiled_json([](json& top) { top["frames"][1]["exposure"] = 1e-308; }),
       kInput,
       {"transforms.json", "frames[1].exposure", "0.0001 to 10000", "1e-308"}},
      {"focal_length_of_no_lens",
       spoiled_json([](json& top) { top["fl_x"] = 1e308; }),
       kInput,
       {"transforms.json", "focal length", "0.16 to 16000", "1e+308"}},
      {"axis_far_outside",
       spoiled_json([](json& top) { top["cx"] = 1e308; }),
       kInput,
       {"transforms.json", "principal point", "1e+308"}},
      {"distortion_of_no_lens",
       spoiled_json([](json& top) { top["k1"] = 1e300; }),
       kInput,
       {"transforms.json", "distortion", "1e+300"}},
      {"pose_out_of_this_world",
       spoiled_json([](json& top) { top["frames"][2]["transform_matrix"][0][3] = -1e300; }),
       kInput,
       {"transforms.json", "frames[2].position", "-1e+300"}},
      {"name_is_not_utf8",
       colmap_then([](const fs::path& model) { replace_in(model / "images.txt", "0.png", "\xFF.png"); }, true),
       kInput,
       {"images.txt", "UTF-8"}},
      {"name_too_long",
       spoiled_json([](json& top) {
         for (json& frame : top["frames"]) frame["file_path"] = std::string(300, 'x');
       }),
       kInput,
       {"found 0 (of 4 listed)"}},
      {"pipe",
       [](const fs::path& folder) { ASSERT_EQ(::mkfifo((folder / "transforms.json").c_str(), 0600), 0); },
       kInput,
       {"transforms.json", "pipe"}},
      {"json_is_a_list",
       [](const fs::path& folder) { write_file(folder / "transforms.json", "[]"); },
       kInput,
       {"transforms.json", "expected an object, found array"}},
      {"no_frames", spoiled_json([](json& top) { top.erase("frames"); }), kInput, {"frames", "found nothing"}},
      {"frame_is_a_number", spoiled_json([](json& top) { top["frames"][1] = 5; }), kInput, {"frames[1]", "number"}},
      {"no_file_path",
       spoiled_json([](json& top) { top["frames"][2].erase("file_path"); }),
       kInput,
       {"frames[2].file_path"}},
      {"no_matrix",
       spoiled_json([](json& top) { top["frames"][2].erase("transform_matrix"); }),
       kInput,
       {"frames[2].transform_matrix", "found nothing"}},
      {"matrix_3x4",
       spoiled_json([](json& top) { top["frames"][3]["transform_matrix"].erase(3); }),
       kInput,
       {"transforms.json: frames[3].transform_matrix: expected 4x4, got 3x4"}},
      {"matrix_of_text",
       spoiled_json([](json& top) { top["frames"][3]["transform_matrix"][0][0] = "x"; }),
       kInput,
       {"frames[3].transform_matrix", "expected numbers"}},
      {"last_row",
       spoiled_json([](json& top) { top["frames"][0]["transform_matrix"][3][0] = 1; }),
       kInput,
       {"frames[0].transform_matrix", "0 0 0 1"}},
      {"null_in_matrix",
       spoiled_json([](json& top) { top["frames"][0]["transform_matrix"][1][1] = nullptr; }),
       kInput,
       {"frames[0].transform_matrix", "found null"}},
      {"nan_in_json",
       transforms_then([](const fs::path& folder) { replace_in(folder / "transforms.json", "20.0", "NaN"); }),
       kInput,
       {"transforms.json", "expected JSON"}},
      {"skewed_pose",
       spoiled_json([](json& top) { top["frames"][1]["transform_matrix"][0][0] = 3; }),
       kInput,
       {"frames[1].transform_matrix", "found"}},
      {"singular_pose",
       spoiled_json([](json& top) {
         for (int c = 0; c < 3; ++c) top["frames"][1]["transform_matrix"][0][std::size_t(c)] = 0;
       }),
       kInput,
       {"frames[1].transform_matrix", "singular"}},
      {"mirrored_pose",
       spoiled_json([](json& top) {
         for (int r = 0; r < 3; ++r) {
           json& entry = top["frames"][1]["transform_matrix"][std::size_t(r)][0];
           entry = -double(entry);
         }
       }),
       kInput,
       {"frames[1].transform_matrix", "mirrored"}},
      {"no_focal_length",
       spoiled_json([](json& top) {
         top.erase("fl_x");
         top.erase("fl_y");
       }),
       kInput,
       {"frames[0]", "fl_x", "camera_angle_x"}},
      {"negative_focal_length",
       spoiled_json([](json& top) { top["fl_x"] = -20; }),
       kInput,
       {"focal length", "found -20"}},
      {"focal_length_of_text",
       spoiled_json([](json& top) { top["fl_x"] = "20"; }),
       kInput,
       {"fl_x", "expected a number, found \"20\""}},
      {"width_without_height", spoiled_json([](json& top) { top.erase("h"); }), kInput, {"h", "both w and h"}},
      {"half_pixels", spoiled_json([](json& top) { top["w"] = 16.5; }), kInput, {"w", "16.5"}},
      {"wrong_size",
       spoiled_json([](json& top) { top["w"] = 20; }),
       kInput,
       {"0.png", "expected 20x12", "found 16x12"}},
      {"unknown_lens",
       spoiled_json([](json& top) { top["camera_model"] = "EQUIRECTANGULAR"; }),
       kInput,
       {"camera_model", "EQUIRECTANGULAR"}},
      {"ambiguous_k4", spoiled_json([](json& top) { top["k4"] = 0.1; }), kInput, {"k4"}},
      {"bad_box",
       spoiled_json([](json& top) {
         top["aabb"] = {1, 2};
       }),
       kInput,
       {"aabb"}},
      {"endless_box",
       spoiled_json([](json& top) {
         top["aabb"] = {{-1, -1, -1}, {1, 2147483647, 1}};
       }),
       kInput,
       {"aabb", "2147483647"}},
      {"endless_depth",
       spoiled_json([](json& top) {
         top["depth_range"] = {0.5, 1e10};
       }),
       kInput,
       {"depth_range"}},

      {"truncated_png", transforms_then(truncated("images/1.png", 0.6)), kInput, {"images/1.png"}},
      {"truncated_jpeg",
       transforms_then([](const fs::path& folder) {
         cv::Mat noise(test::kHeight, test::kWidth, CV_8UC3);
         cv::randu(noise, 0, 256);
         cv::imwrite(folder / "images/1.jpg", noise);
         fs::rename(folder / "images/1.jpg", folder / "images/1.png");
         truncated("images/1.png", 0.9)(folder);
       }),
       kInput,
       {"images/1.png", "cut short"}},
      {"text_as_image",
       transforms_then([](const fs::path& folder) { write_file(folder / "images/2.png", "hello"); }),
       kInput,
       {"images/2.png"}},
      {"mask_of_another_shape",
       transforms_then([](const fs::path& folder) {
         json top = json::parse(read_text_file(folder / "transforms.json"));
         test::write_grey_image(folder / "mask.png", 9, 9);
         top["frames"][0]["mask_path"] = "mask.png";
         test::write_json(folder / "transforms.json", top);
       }),
       kInput,
       {"mask.png", "16x12", "9x9"}},
      {"missing_mask",
       spoiled_json([](json& top) { top["frames"][0]["mask_path"] = "none.png"; }),
       kMissing,
       {"none.png"}},
      {"mask_of_ones", masked_by(1), kInput, {"mask.png", "values", "the lightest is 1 of 255"}},
      {"everything_masked", masked_by(0), kInput, {"masks", "found all masked"}},

      {"colmap_cameras_cut",
       colmap_then(truncated("cameras.bin", 0.8)),
       kInput,
       {"cameras.bin", "camera 1 of 1", "cut short"}},
      {"colmap_lens_of_no_camera",
       colmap_then([](const fs::path& model) { replace_in(model / "cameras.txt", " 20 ", " 1e308 "); }, true),
       kInput,
       {"cameras.txt", "focal length", "1e+308"}},
      {"colmap_one_focal_length_of_zero",
       colmap_then([](const fs::path& model) { replace_in(model / "cameras.txt", " 20 ", " 0 "); }, true),
       kInput,
       {"cameras.txt", "line 2", "focal length", "above 0"}},
      {"colmap_images_cut", colmap_then(truncated("images.bin", 0.6)), kInput, {"images.bin", "of 4", "cut short"}},
      {"colmap_points_cut", colmap_then(truncated("points3D.bin", 0.7)), kInput, {"points3D.bin", "cut short"}},
      {"colmap_empty_file",
       colmap_then([](const fs::path& model) { write_file(model / "images.bin", ""); }),
       kInput,
       {"images.bin", "number of images"}},
      {"colmap_no_images_file",
       colmap_then([](const fs::path& model) { fs::remove(model / "images.bin"); }),
       kMissing,
       {"images"}},
      {"colmap_unknown_model",
       [](const fs::path& folder) {
         test::write_colmap_images(folder / "images");
         test::write_colmap_binary(folder / "sparse", {7, "FOV", {20, 21, 8, 6, 1}});
       },
       kInput,
       {"cameras.bin", "number 7"}},
      {"colmap_text_unknown_model",
       [](const fs::path& folder) {
         test::write_colmap_images(folder / "images");
         test::write_colmap_text(folder / "sparse", {7, "FOV", {20, 21, 8, 6, 1}});
       },
       kInput,
       {"cameras.txt", "line 2", "FOV"}},
      {"colmap_text_nan",
       colmap_then(
           [](const fs::path& model) {
             write_file(model / "images.txt", "1 nan 0 0 0 1 2 3 3 0.png\n\n2 1 0 0 0 1 2 3 3 1.png\n\n");
           },
           true),
       kInput,
       {"images.txt", "line 1"}},
      {"colmap_text_quaternion",
       colmap_then(
           [](const fs::path& model) {
             write_file(model / "images.txt", "1 2 0 0 0 1 2 3 3 0.png\n\n2 1 0 0 0 1 2 3 3 1.png\n\n");
           },
           true),
       kInput,
       {"image 0.png", "quaternion", "length 2"}},
      {"colmap_text_unknown_camera",
       colmap_then(
           [](const fs::path& model) {
             write_file(model / "images.txt", "1 1 0 0 0 1 2 3 8 0.png\n\n2 1 0 0 0 1 2 3 3 1.png\n\n");
           },
           true),
       kInput,
       {"image 0.png", "number 8"}},
      {"colmap_text_short_line",
       colmap_then([](const fs::path& model) { write_file(model / "cameras.txt", "3 PINHOLE 16 12 20 21\n"); }, true),
       kInput,
       {"cameras.txt", "line 1"}},

      {"llff_cut", llff_then(truncated("poses_bounds.npy", 0.7)), kInput, {"poses_bounds.npy", "cut short"}},
      {"llff_dtype",
       llff_then([](const fs::path& folder) {
         test::write_npy(folder / "poses_bounds.npy", "<c8", false, "4, 17", test::bytes_of(test::llff_rows(4)));
       }),
       kInput,
       {"poses_bounds.npy", "descr", "<c8"}},
      {"llff_shape",
       llff_then([](const fs::path& folder) { write_llff_rows(folder, test::llff_rows(4), "17, 4"); }),
       kInput,
       {"shape", "expected Nx17, found 17x4"}},
      {"llff_count",
       llff_then([](const fs::path& folder) { write_llff_rows(folder, test::llff_rows(3), "3, 17"); }),
       kInput,
       {"4 images", "found 3"}},
      {"llff_nan_pose",
       llff_then([](const fs::path& folder) {
         std::vector<double> rows = test::llff_rows(4);
         rows[17 + 3] = NAN;
         write_llff_rows(folder, rows, "4, 17");
       }),
       kInput,
       {"poses_bounds.npy", "row 1", "NaN"}},
      {"llff_bounds",
       llff_then([](const fs::path& folder) {
         std::vector<double> rows = test::llff_rows(4);
         rows[2 * 17 + 15] = 99;
         write_llff_rows(folder, rows, "4, 17");
       }),
       kInput,
       {"row 2", "near < far"}},
      {"llff_focal_length",
       llff_then([](const fs::path& folder) {
         std::vector<double> rows = test::llff_rows(4);
         rows[14] = 0;
         write_llff_rows(folder, rows, "4, 17");
       }),
       kInput,
       {"row 0", "focal length"}},
      {"llff_no_images",
       llff_then([](const fs::path& folder) { fs::remove_all(folder / "images"); }),
       kMissing,
       {"images"}},
  };
}

class BadCaptures : public testing::TestWithParam<BadCapture> {};

TEST_P(BadCaptures, AreRefusedWithAReason) {
  const test::TempDir folder;
  GetParam().make(folder.path());
  try {
    (void)load_capture(folder.path());
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), GetParam().code) << error.what();
    for (const std::string& part : GetParam().says) EXPECT_THAT(error.what(), HasSubstr(part));
  }
}

INSTANTIATE_TEST_SUITE_P(All, BadCaptures, testing::ValuesIn(bad_captures()),
                         [](const auto& name_of) { return name_of.param.name; });

TEST(BadOptions, AreUsageErrors) {
  const test::TempDir folder;
  (void)test::write_transforms(folder.path());
  EXPECT_THROW((void)load_capture(folder.path(), {.holdout = 1}), UsageError);
  EXPECT_THROW((void)load_capture(folder.path(), {.downscale = 0}), UsageError);
  EXPECT_THROW((void)load_capture(folder.path(), {.transfer = "log"}), UsageError);
}

TEST(BadOptions, AnImageIsNotACapture) {
  const test::TempDir folder;
  (void)test::write_transforms(folder.path());
  EXPECT_THROW((void)load_capture(folder / "images/0.png"), InputError);
}

}  // namespace
}  // namespace cnerf
