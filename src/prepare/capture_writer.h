#pragma once
/// The files of a prepared capture.

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "src/capture/capture.h"
#include "src/prepare/photographs.h"
#include "src/prepare/upright.h"

namespace cnerf::prepare {

/// transforms.json of views whose `name` is a file below `images/`, in the frame of their poses. Reading it back with
/// `load_capture` gives the same cameras.
/// @param images  of the same names; their masks and exposures are listed.
/// @param with_points  there is a kPointsFile
/// @throws InputError  a lens that transforms.json cannot say (the rational model's denominator).
[[nodiscard]] nlohmann::ordered_json transforms_json(const std::vector<View>& views,
                                                     const std::vector<PreparedImage>& images,
                                                     const std::optional<SubjectBox>& subject,
                                                     bool with_points = false);

/// The file of points beside transforms.json, which names it.
inline constexpr const char* kPointsFile = "points3D.txt";
/// Points in COLMAP's text format; the images of their tracks are numbers of the frames in transforms.json.
[[nodiscard]] std::string points_text(const std::vector<SparsePoint>& points);

/// A picture of the capture: every view small with the subject's box drawn in, and cameras, points and box from above
/// and from the side.  @throws OutputError, InputError.
void write_contact_sheet(const std::filesystem::path& file, const std::filesystem::path& capture,
                         const std::vector<View>& views, const std::vector<Vec3d>& points,
                         const std::optional<SubjectBox>& subject);

}  // namespace cnerf::prepare
