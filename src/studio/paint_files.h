#pragma once
/// Files of a studio: what is painted as pictures, and the folders of takes.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <opencv2/core.hpp>
#include <span>
#include <string>
#include <vector>

#include "src/base/observer.h"
#include "src/capture/capture.h"
#include "src/pipeline/run_context.h"
#include "src/train/chroma/strokes.h"

namespace cnerf::studio {

inline constexpr const char* kStrokeFile = "strokes.json";
inline constexpr const char* kNow = "now";  ///< what a picture shows: no take's name, as "" is none: uncoloured

/// Where a run keeps what is painted.
[[nodiscard]] std::filesystem::path stroke_folder(const pipeline::RunContext& context);
/// The painted pictures that strokes name.
void copy_pictures(std::span<const Stroke> strokes, const PaintedPictures& from, const PaintedPictures& to);
/// Writes a list with the painted pictures that it names.
/// @param from  where these lie
void write_strokes_whole(const std::filesystem::path& folder, const StrokeList& list, const PaintedPictures& from);

/// Colours at the luminance that is there: B G R A, 8 bits, transparent where nothing is known.
/// @param luminance  linear Y of a pixel
[[nodiscard]] cv::Mat colors_at_luminance(const RunningColors& colors, cv::Size size, std::uint8_t alpha,
                                          const std::function<float(std::size_t pixel)>& luminance);

/// Writes VIEW.png, as PictureNames has it, into the folder for each view that is painted on, transparent except for
/// paint, as --hint-image takes them; those of views that are not any more go. Viewpoints have none.
/// @throws OutputError
void write_paint_pictures(const std::filesystem::path& folder, const Capture& capture,
                          const std::vector<Stroke>& strokes);

/// A finished take under another name.  @throws UsageError  no such take, or a take of the new name; BusyError
void duplicate(const pipeline::RunDirectory& directory, const std::string& take, const std::string& name,
               Observer& observer);
/// Gives a take another name, also where others were begun from it.  @throws  as `duplicate`
void rename(const pipeline::RunDirectory& directory, const std::string& take, const std::string& name,
            Observer& observer);
/// Removes a take.
/// @param successor  what the run's current take is where it was this; empty = another, or none
/// @throws UsageError  no such take, or another was begun from it and could not be made again; BusyError
void remove(const pipeline::RunDirectory& directory, const std::string& take, const std::string& successor,
            Observer& observer);

}  // namespace cnerf::studio
