#pragma once
/// Stage 1: luminance and density from monochrome views (paper, Sec. "Luminance and density representation").

#include <filesystem>
#include <memory>
#include <string>

#include "encoding/hash_grid_levels.h"
#include "src/base/observer.h"
#include "src/base/options.h"
#include "src/capture/arrangement.h"
#include "src/capture/capture.h"
#include "src/engine/engines.h"
#include "src/field/scene_frame.h"
#include "src/render/occupancy_grid.h"

namespace cnerf {

/// Where the field's box lies. Placed by itself from cameras, depth range and points; numbers given here win.
struct PlacementOptions {
  int cascades = 0;                                 ///< 0 = chosen by the kind of capture
  double scale = 0;                                 ///< unit lengths per world unit; 0 = chosen
  double centre_x = 0, centre_y = 0, centre_z = 0;  ///< world; used when `fixed_centre`
  bool fixed_centre = false;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("cascades", cascades, Range{0, 8}, "nested boxes; 0 chooses by the kind of capture");
    v("scale", scale, Range{0, 1e9}, "unit lengths per world unit; 0 chooses");
    v("fixed_centre", fixed_centre, "use centre_x, centre_y, centre_z instead of choosing");
    v("centre_x", centre_x, Range{-1e9, 1e9}, "centre of the box, world units");
    v("centre_y", centre_y, Range{-1e9, 1e9}, "centre of the box, world units");
    v("centre_z", centre_z, Range{-1e9, 1e9}, "centre of the box, world units");
  }
};

struct Stage1Options {
  int steps = 5000;                   ///< optimiser steps
  double max_seconds = 0;             ///< stop earlier after this much training time; 0 = no limit
  int samples_per_step = 65536;       ///< trained samples a step aims at; rays a step follow from it
  std::string sampling = "pixels";    ///< independent pixels, or the paper's K x K patches
  int patch_size = 32;                ///< K of patch sampling
  double learning_rate = 1e-2;        ///< of Adam at the start
  double final_learning_rate = 5e-4;  ///< reached by exponential decay over the last half
  double distortion_weight = 3e-4;    ///< of a ray's distortion in the loss (src/render/distortion_math.h)
  int steps_per_box = 256;            ///< march steps across the innermost cascade's side
  double cone_angle = 1.0 / 64;       ///< march step over distance, where there are several cascades
  int checkpoint_every = 1000;        ///< steps between snapshots; 0 = only at the end
  int seed = 1;
  HashGridOptions grid = {.decay = 0.1};
  OccupancyOptions occupancy;
  PlacementOptions placement;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("steps", steps, Range{1, 1e8}, "optimiser steps");
    v("max_seconds", max_seconds, Range{0, 1e9}, "stop after this much training time; 0 = no limit");
    v("samples_per_step", samples_per_step, Range{1024, 1 << 24}, "trained samples a step aims at");
    v("sampling", sampling, Choice{"pixels", "patches"},
      "independent pixels, or K x K patches (paper, Eq. patch sampling)");
    v("patch_size", patch_size, Range{4, 256}, "K of patch sampling");
    v("learning_rate", learning_rate, Range{1e-8, 1}, "Adam's step size at the start");
    v("final_learning_rate", final_learning_rate, Range{1e-8, 1}, "Adam's step size at the end");
    v("distortion_weight", distortion_weight, Range{0, 10},
      "of a loss on how far apart the samples of a ray lie: against fog and floaters");
    v("steps_per_box", steps_per_box, Range{16, 8192}, "march steps across the side of the innermost cascade");
    v("cone_angle", cone_angle, Range{1e-4, 1}, "march step over distance, in scenes of several cascades");
    v("checkpoint_every", checkpoint_every, Range{0, 1e8}, "steps between snapshots; 0 = only at the end");
    v("seed", seed, Range{0, 1e9}, "of weights, rays and jitter");
    v.section("grid", grid);
    v.section("occupancy", occupancy);
    v.section("placement", placement);
  }
};

/// Chooses the field's box for a capture. Deterministic.
[[nodiscard]] SceneFrame place_scene(const Capture& capture, const PlacementOptions& options);

struct Stage1Report {
  int steps = 0;
  double seconds = 0;  ///< training time only, over all resumed parts
  double trained_samples = 0;
  double train_psnr = 0;  ///< luminance dB over the last 100 steps' rays
};

/// Whether a training with these options may go on from `snapshot`, if there is one.
/// @throws SnapshotError  it is of another version, damaged, or of a training with other options.
void check_continues(const std::filesystem::path& snapshot, const Stage1Options& options);

/// What stage 1 works on.
struct Stage1Job {
  const Capture& capture;
  const Stage1Options& options;
  std::filesystem::path snapshot;  ///< that the result goes to
  bool resume = false;             ///< go on with the snapshot, if there is one
};

/// Trains and leaves the result in the job's snapshot. What the observer takes is no training time; previews show
/// held-out views, or some of all. Resuming continues bit for bit on the CPU, whatever the number of threads.
/// @throws Interrupted    after saving, when the observer cancelled.
/// @throws SnapshotError  the snapshot is of another version, cut short, or of another configuration.
Stage1Report train_stage1(const Stage1Job& job, const Engines& engines, Observer& observer);

}  // namespace cnerf
