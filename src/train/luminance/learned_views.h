#pragma once
/// What stage 1 learned of its views, put where everything behind it looks: into their capture.

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "src/capture/capture.h"
#include "src/field/scene_frame.h"
#include "src/render/view_correction.h"
#include "src/train/luminance/luminance_model.h"

namespace cnerf {

/// Where a camera really stood, world space.
[[nodiscard]] Affined corrected_pose(const Affined& world_from_camera, const ViewCorrection& correction,
                                     const SceneFrame& frame);
/// Where it was given to stand: the way back.
[[nodiscard]] Affined given_pose(const Affined& world_from_camera, const ViewCorrection& correction,
                                 const SceneFrame& frame);

/// The logarithms of all views' gains. What training never saw gets the mean of its neighbours in the capture's order
/// where that tells the gains of training views better than the median view's does, as in a clip or a round of
/// pictures.
[[nodiscard]] std::vector<float> log_gains(const Capture& capture, std::span<const ViewCorrection> corrections);

/// What is to be told of it: how far exposures, cameras and lenses are from what was given. Nothing where nothing was
/// learned.
struct LearnedFact {
  std::string name, text;
};
/// @param given  the lenses as the capture has them (`lenses_of`); empty: unknown, and only the changes are told
[[nodiscard]] std::vector<LearnedFact> facts_of(const LearnedViews& learned, std::span<const Intrinsics> given = {});

/// Training views get the poses, exposures and lenses that were learned; held-out ones an exposure (`log_gains`), and
/// the lens where they share one that was.
void apply_learned_views(Capture& capture, const LearnedViews& learned);
/// The same from a training's snapshot. Returns its facts in lines, and a note of cameras so far off that
/// something else is wrong.
/// @throws MissingInputError, SnapshotError  also when it was trained with other cameras than the capture was read with
std::vector<std::string> apply_learned_views(Capture& capture, const std::filesystem::path& stage1_snapshot);

}  // namespace cnerf
