#pragma once
/// What a poses file says, before any image is opened: readers make listings, load_capture turns them into captures.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "src/capture/capture.h"

namespace cnerf {

struct ListedView {
  std::string name;                  ///< as the poses name it
  std::string field;                 ///< where in the poses file, e.g. "frames[3]"; for messages
  std::filesystem::path poses_file;  ///< the file that lists it; for messages
  std::filesystem::path lens_file;   ///< the file that states the intrinsics, if it is another one; for messages
  std::filesystem::path image_file;  ///< may not exist
  std::filesystem::path full_file;   ///< of which `image_file` is a reduced copy; empty: of none
  std::filesystem::path mask_file;   ///< empty: none
  std::uint32_t number = 0;          ///< by which points name it
  /// For the stated size. Without one (width 0) it is for the size of the image, and a principal point of
  /// `kCentred` is its centre; without a focal length (fx 0) that follows from the angles of view.
  Intrinsics intrinsics;
  double angle_x = 0, angle_y = 0;  ///< full angles of view, radians; 0: not stated
  Affined world_from_camera;        ///< rigid, axes of camera.h
  double exposure = 1;              ///< light of the image over that of the others
  double haze = 0;                  ///< linear light that lies over the image alone
  double downscale = 1;             ///< still to be applied to the image file
  bool held_out = false;

  [[nodiscard]] const std::filesystem::path& file_of_lens() const { return lens_file.empty() ? poses_file : lens_file; }
};
/// A principal point that no file states.
inline constexpr double kCentred = -1e30;

struct CaptureListing {
  std::filesystem::path source;  ///< the poses file or model folder
  std::string format;
  std::vector<ListedView> views;
  std::size_t listed_images = 0;    ///< also those whose files do not exist
  std::vector<SparsePoint> points;  ///< `views` are numbers of listed views, in any order
  std::optional<DepthRange> depth_range;
  std::optional<Aabbd> bounds;
  std::vector<std::string> notes;
};

/// The points of a listing with views by their places instead of their numbers; those that are not listed are left out.
[[nodiscard]] std::vector<SparsePoint> points_by_place(const CaptureListing& listing);

/// Makes the poses of a listing rigid and notes how far off they were.
/// @throws InputError  as `rigid_pose` does, naming the view.
void make_poses_rigid(CaptureListing& listing, const std::string& matrix_name);

/// Moves poses that are so far from their origin that they can only be in a frame of the Earth or of a map, and notes
/// by how much: 32-bit numbers of volumes and meshes would round such positions to centimetres or worse.
void bring_near_origin(CaptureListing& listing);

/// transforms.json in the dialects of NeRF, instant-ngp and nerfstudio. `transforms_train.json` brings its siblings for
/// validation and test along.  @throws InputError.
[[nodiscard]] CaptureListing read_transforms(const std::filesystem::path& json_file);

/// A COLMAP model, binary or text.  @param root  the capture folder, where images are looked for first.
/// @throws InputError, MissingInputError.
[[nodiscard]] CaptureListing read_colmap(const std::filesystem::path& root, const std::filesystem::path& model_folder);
/// COLMAP's points3D.txt or points3D.bin alone; those that are no finite numbers are left out.
/// @throws MissingInputError, InputError.
[[nodiscard]] std::vector<SparsePoint> read_colmap_points(const std::filesystem::path& file);
/// Registered images of a model, to choose between several.
[[nodiscard]] std::size_t colmap_image_count(const std::filesystem::path& model_folder);
/// Where an image shows a sparse point.
struct ColmapObservation {
  std::string image;
  double x = 0, y = 0;  ///< pixels
  std::int64_t point = 0;
};
/// Those of a model that show a point.  @throws InputError, MissingInputError.
[[nodiscard]] std::vector<ColmapObservation> read_colmap_observations(const std::filesystem::path& model_folder);

/// LLFF's poses_bounds.npy; `downscale` chooses among images, images_2, ….  @throws InputError, MissingInputError.
[[nodiscard]] CaptureListing read_llff(const std::filesystem::path& npy_file, int downscale);

/// cameras.xml of Agisoft Metashape: frame and equidistant fisheye cameras, transforms of chunks and components.
/// @throws MissingInputError, InputError.
[[nodiscard]] CaptureListing read_metashape(const std::filesystem::path& xml_file);

/// The table "Internal/External camera parameters" of RealityCapture and RealityScan, and their sidecars, one .xmp per
/// image in a folder.  @throws MissingInputError, InputError.
[[nodiscard]] CaptureListing read_realitycapture_table(const std::filesystem::path& csv_file);
[[nodiscard]] CaptureListing read_realitycapture_sidecars(const std::filesystem::path& folder);
/// The first such table of a folder; the folder of such sidecars, which is that of the capture or `images` in it.
[[nodiscard]] std::optional<std::filesystem::path> find_realitycapture_table(const std::filesystem::path& root);
[[nodiscard]] std::optional<std::filesystem::path> find_realitycapture_sidecars(const std::filesystem::path& root);

/// Polycam's raw data: a folder with one .json per image, which lies in the folder of images beside it.
/// @throws MissingInputError, InputError.
[[nodiscard]] CaptureListing read_polycam(const std::filesystem::path& cameras_folder);
/// The folder of a capture's corrected cameras, else that of those which the phone estimated.
[[nodiscard]] std::optional<std::filesystem::path> find_polycam_cameras(const std::filesystem::path& root);

/// metadata.json of Record3D, with images in `rgb` or `rgbd` beside it.  @throws MissingInputError, InputError.
[[nodiscard]] CaptureListing read_record3d(const std::filesystem::path& json_file);
[[nodiscard]] std::optional<std::filesystem::path> find_record3d_metadata(const std::filesystem::path& root);

/// The image that `name` means in a folder: as it stands, else with an extension appended, which synthetic sets and
/// labels leave out. Where there is none, the name as it stands.
[[nodiscard]] std::filesystem::path named_image(const std::filesystem::path& folder, std::string name);
/// The same, where images lie beside the poses or in `images`.
[[nodiscard]] std::filesystem::path image_near_poses(const std::filesystem::path& folder, const std::string& name);

/// The files of a folder with this extension, in either case, in the order of their names; none where there is none.
[[nodiscard]] std::vector<std::filesystem::path> files_with_extension(const std::filesystem::path& folder,
                                                                      const std::string& extension);

/// A copy of the image reduced by `downscale` in a sibling folder `<folder>_<downscale>`; nothing when there is none.
[[nodiscard]] std::optional<std::filesystem::path> reduced_copy(const std::filesystem::path& image_file, int downscale);

/// True for names of image files that image_io.h reads, in either case.
[[nodiscard]] bool is_image_file(const std::filesystem::path& file);
/// The extensions tried for names without one, in order.
[[nodiscard]] const std::vector<std::string>& image_extensions();

}  // namespace cnerf
