#include "tests/capture/fixtures.h"

#include <cmath>
#include <cstring>
#include <fstream>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "src/base/files.h"

namespace cnerf::test {
namespace fs = std::filesystem;
namespace {

/// Little-endian values, one after the other.
class Bytes {
 public:
  template <typename T>
  Bytes& add(T value) {
    text_.append(reinterpret_cast<const char*>(&value), sizeof value);
    return *this;
  }
  Bytes& add_text(const std::string& text) {
    text_ += text;
    text_ += '\0';
    return *this;
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string text_;
};

struct StoredPose {
  Quaternion q;
  Vec3d t;
};
StoredPose colmap_pose(int index, int count) {
  const Affined camera_from_world = ring_pose(index, count).inverse();
  return {quaternion_of(camera_from_world.linear), camera_from_world.translation};
}

}  // namespace

Quaternion quaternion_of(const Mat3d& m) {
  const double xx = m.rows[0].x;
  const double yy = m.rows[1].y;
  const double zz = m.rows[2].z;
  Quaternion q = {std::sqrt(std::max(0.0, 1 + xx + yy + zz)) / 2, std::sqrt(std::max(0.0, 1 + xx - yy - zz)) / 2,
                  std::sqrt(std::max(0.0, 1 - xx + yy - zz)) / 2, std::sqrt(std::max(0.0, 1 - xx - yy + zz)) / 2};
  q.x = std::copysign(q.x, m.rows[2].y - m.rows[1].z);
  q.y = std::copysign(q.y, m.rows[0].z - m.rows[2].x);
  q.z = std::copysign(q.z, m.rows[1].x - m.rows[0].y);
  return q;
}

Affined ring_pose(int index, int count) {
  const double angle = 2 * std::numbers::pi * (index + 0.3) / count;
  const Vec3d position = {4 * std::cos(angle), 4 * std::sin(angle), 1.5};
  const Vec3d forward = normalized(-position);
  const Vec3d right = normalized(cross(forward, Vec3d{0, 0, 1}));
  return {Mat3d::from_columns(right, cross(forward, right), forward), position};
}

std::uint8_t grey_value(int x, int y, int seed) {
  return std::uint8_t(x * 7 + y * 11 + seed);
}

void write_grey_image(const fs::path& file, int width, int height, int seed) {
  fs::create_directories(file.parent_path());
  cv::Mat1b image(height, width);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) image(y, x) = grey_value(x, y, seed);
  }
  cv::imwrite(file.string(), image);
}

nlohmann::json opengl_matrix(const Affined& pose) {
  nlohmann::json rows = nlohmann::json::array();
  for (int i = 0; i < 3; ++i) {
    const Vec3d r = pose.linear.rows[i];
    rows.push_back({r.x, -r.y, -r.z, pose.translation[i]});
  }
  rows.push_back({0, 0, 0, 1});
  return rows;
}

nlohmann::json write_transforms(const fs::path& folder, int views) {
  nlohmann::json top = {{"w", kWidth}, {"h", kHeight}, {"fl_x", 20.0}, {"fl_y", 21.0}, {"cx", 8.5}, {"cy", 5.5}};
  for (int i = 0; i < views; ++i) {
    const std::string name = "images/" + std::to_string(i) + ".png";
    write_grey_image(folder / name, kWidth, kHeight, i);
    top["frames"].push_back({{"file_path", name}, {"transform_matrix", opengl_matrix(ring_pose(i, views))}});
  }
  write_json(folder / "transforms.json", top);
  return top;
}

void write_json(const fs::path& file, const nlohmann::json& value) {
  write_file(file, value.dump(1));
}

void write_npy(const fs::path& file, const std::string& dtype, bool fortran_order, const std::string& shape,
               const std::string& values, int version) {
  std::string header = "{'descr': '" + dtype + "', 'fortran_order': " + (fortran_order ? "True" : "False") +
                       ", 'shape': (" + shape + "), }";
  const std::size_t fixed = version == 1 ? 10 : 12;
  header += std::string(63 - (fixed + header.size()) % 64, ' ') + "\n";
  std::string out = "\x93NUMPY";
  out += char(version);
  out += '\0';
  for (std::size_t i = 0; i < (version == 1 ? 2u : 4u); ++i) out += char(header.size() >> (8 * i) & 0xFF);
  write_file(file, out + header + values);
}

std::vector<double> llff_rows(int views) {
  std::vector<double> rows;
  for (int i = 0; i < views; ++i) {
    const Affined pose = ring_pose(i, views);
    const Vec3d right = pose.linear.column(0);
    const Vec3d down = pose.linear.column(1);
    const Vec3d forward = pose.linear.column(2);
    const double intrinsics[3] = {kHeight, kWidth, 20};
    for (int r = 0; r < 3; ++r) {
      rows.insert(rows.end(), {down[r], right[r], -forward[r], pose.translation[r], intrinsics[r]});
    }
    rows.insert(rows.end(), {2.0 + i, 9.0 + i});
  }
  return rows;
}

void write_llff(const fs::path& folder, int views, const std::string& image_folder, int width, int height) {
  for (int i = 0; i < views; ++i) {
    write_grey_image(folder / image_folder / ("img" + std::to_string(i) + ".png"), width, height, i);
  }
  write_npy(folder / "poses_bounds.npy", "<f8", false, std::to_string(views) + ", 17", bytes_of(llff_rows(views)));
}

void write_colmap_images(const fs::path& image_folder, int images) {
  for (int i = 0; i < images; ++i) write_grey_image(image_folder / (std::to_string(i) + ".png"), kWidth, kHeight, i);
}

void write_colmap_binary(const fs::path& model_folder, const ColmapModel& model) {
  Bytes cameras;
  cameras.add(std::uint64_t(1)).add(std::uint32_t(3)).add(std::int32_t(model.model_number));
  cameras.add(std::uint64_t(kWidth)).add(std::uint64_t(kHeight));
  for (const double p : model.parameters) cameras.add(p);
  write_file(model_folder / "cameras.bin", cameras.text());

  Bytes images;
  images.add(std::uint64_t(model.images));
  for (int i = 0; i < model.images; ++i) {
    const auto [q, t] = colmap_pose(i, model.images);
    images.add(std::uint32_t(i + 1)).add(q.w).add(q.x).add(q.y).add(q.z).add(t.x).add(t.y).add(t.z);
    images.add(std::uint32_t(3)).add_text(std::to_string(i) + ".png").add(std::uint64_t(2));
    for (int k = 0; k < 2; ++k) images.add(1.5).add(2.5).add(std::uint64_t(1));
  }
  write_file(model_folder / "images.bin", images.text());

  Bytes points;
  points.add(std::uint64_t(2));
  for (int i = 0; i < 2; ++i) {
    points.add(std::uint64_t(i + 1)).add(0.5 + i).add(-1.0).add(2.0).add(std::uint8_t(9)).add(std::uint8_t(9));
    points.add(std::uint8_t(9)).add(0.7).add(std::uint64_t(1)).add(std::uint32_t(1)).add(std::uint32_t(0));
  }
  write_file(model_folder / "points3D.bin", points.text());
}

void write_colmap_text(const fs::path& model_folder, const ColmapModel& model) {
  std::ostringstream cameras;
  cameras.precision(17);
  cameras << "# Camera list\n3 " << model.model_name << ' ' << kWidth << ' ' << kHeight;
  for (const double p : model.parameters) cameras << ' ' << p;
  write_file(model_folder / "cameras.txt", cameras.str() + "\n");

  std::ostringstream images;
  images.precision(17);
  images << "# Image list\n# two lines per image\n";
  for (int i = 0; i < model.images; ++i) {
    const auto [q, t] = colmap_pose(i, model.images);
    images << i + 1 << ' ' << q.w << ' ' << q.x << ' ' << q.y << ' ' << q.z << ' ' << t.x << ' ' << t.y << ' ' << t.z
           << " 3 " << i << ".png\n"
           << (i % 2 == 0 ? "1.5 2.5 1 3.5 4.5 -1\n" : "\n");  // an image without observations has an empty line
  }
  write_file(model_folder / "images.txt", images.str());
  write_file(model_folder / "points3D.txt", "# Points\n1 0.5 -1 2 9 9 9 0.7 1 0\n2 1.5 -1 2 9 9 9 0.7 1 0\n");
}

void write_colmap_rigs_binary(const fs::path& model_folder, const ColmapModel& model) {
  constexpr std::int32_t kCamera = 0;  // a kind of sensor
  Bytes rigs;
  rigs.add(std::uint64_t(1)).add(std::uint32_t(1)).add(std::uint32_t(1)).add(kCamera).add(std::uint32_t(3));
  write_file(model_folder / "rigs.bin", rigs.text());
  Bytes frames;
  frames.add(std::uint64_t(model.images));
  for (int i = 0; i < model.images; ++i) {
    const auto [q, t] = colmap_pose(i, model.images);
    frames.add(std::uint32_t(i + 1)).add(std::uint32_t(1));
    frames.add(q.w).add(q.x).add(q.y).add(q.z).add(t.x).add(t.y).add(t.z);
    frames.add(std::uint32_t(1)).add(kCamera).add(std::uint32_t(3)).add(std::uint64_t(i + 1));
  }
  write_file(model_folder / "frames.bin", frames.text());
}

void write_colmap_rigs_text(const fs::path& model_folder, const ColmapModel& model) {
  write_file(model_folder / "rigs.txt", "# Rig calib list\n1 1 CAMERA 3\n");
  std::ostringstream frames;
  frames.precision(17);
  frames << "# Frame list\n";
  for (int i = 0; i < model.images; ++i) {
    const auto [q, t] = colmap_pose(i, model.images);
    frames << i + 1 << " 1 " << q.w << ' ' << q.x << ' ' << q.y << ' ' << q.z << ' ' << t.x << ' ' << t.y << ' ' << t.z
           << " 1 CAMERA 3 " << i + 1 << '\n';
  }
  write_file(model_folder / "frames.txt", frames.str());
}

std::string text_of(const std::vector<double>& numbers) {
  std::ostringstream text;
  text.precision(17);
  for (const double number : numbers) text << (text.tellp() > 0 ? " " : "") << number;
  return text.str();
}

std::vector<double> rows_of(const Mat3d& matrix) {
  std::vector<double> numbers;
  for (const Vec3d row : matrix.rows) numbers.insert(numbers.end(), {row.x, row.y, row.z});
  return numbers;
}

void truncate_file(const fs::path& file, double share) {
  fs::resize_file(file, std::uintmax_t(double(fs::file_size(file)) * share));
}

}  // namespace cnerf::test
