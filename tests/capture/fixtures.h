#pragma once
/// Small captures that tests write, and spoil.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "src/base/vec3.h"
#include "src/capture/camera.h"

namespace cnerf::test {

inline constexpr int kWidth = 16, kHeight = 12;

/// A camera `index` of `count` on a circle, looking at the origin; axes of camera.h.
[[nodiscard]] Affined ring_pose(int index, int count);

/// A grey 8-bit image whose pixels are (x * 7 + y * 11 + seed) mod 256.
void write_grey_image(const std::filesystem::path& file, int width = kWidth, int height = kHeight, int seed = 0);
[[nodiscard]] std::uint8_t grey_value(int x, int y, int seed = 0);

/// A transforms.json of `views` images images/0.png, 1.png, …, which it writes as well.
[[nodiscard]] nlohmann::json write_transforms(const std::filesystem::path& folder, int views = 4);
void write_json(const std::filesystem::path& file, const nlohmann::json& value);
/// The 4x4 rows of a pose in the convention of transforms.json.
[[nodiscard]] nlohmann::json opengl_matrix(const Affined& world_from_camera);

/// An .npy file of any version, type and order.  @param values  bytes in the order of the file.
void write_npy(const std::filesystem::path& file, const std::string& dtype, bool fortran_order,
               const std::string& shape, const std::string& values, int version = 1);
/// The bytes of some numbers.
template <typename T>
[[nodiscard]] std::string bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

/// An LLFF capture of `views` images of kWidth x kHeight in `images`, poses stated for them.
[[nodiscard]] std::vector<double> llff_rows(int views);
void write_llff(const std::filesystem::path& folder, int views = 4, const std::string& image_folder = "images",
                int width = kWidth, int height = kHeight);

/// A COLMAP model with one camera of any model.
struct ColmapModel {
  int model_number = 1;
  std::string model_name = "PINHOLE";
  std::vector<double> parameters = {20, 21, 8, 6};
  int images = 4;
};
void write_colmap_binary(const std::filesystem::path& model_folder, const ColmapModel& model = {});
void write_colmap_text(const std::filesystem::path& model_folder, const ColmapModel& model = {});
/// What COLMAP 3.12 and later put beside a model: a rig of its one camera, and a frame per image.
void write_colmap_rigs_binary(const std::filesystem::path& model_folder, const ColmapModel& model = {});
void write_colmap_rigs_text(const std::filesystem::path& model_folder, const ColmapModel& model = {});
/// The images 0.png, 1.png, … that both models name.
void write_colmap_images(const std::filesystem::path& image_folder, int images = 4);

/// Hamilton quaternion w, x, y, z of a rotation; its trace must not be near -1, as that of no ring pose is.
struct Quaternion {
  double w, x, y, z;
};
[[nodiscard]] Quaternion quaternion_of(const Mat3d& rotation);

/// Numbers with a blank between them, to 17 digits.
[[nodiscard]] std::string text_of(const std::vector<double>& numbers);
/// The nine numbers of a matrix, row by row.
[[nodiscard]] std::vector<double> rows_of(const Mat3d& matrix);

/// Cuts a file to its first `share`.
void truncate_file(const std::filesystem::path& file, double share);

}  // namespace cnerf::test
