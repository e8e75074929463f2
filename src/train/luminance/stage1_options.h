#pragma once
/// What stage 1 can be told.

#include <string>

#include "encoding/hash_grid_levels.h"
#include "src/base/options.h"
#include "src/render/occupancy_grid.h"

namespace cnerf {

/// Where the field's box lies. It is placed by cameras, depth range and points; what is given here wins.
struct PlacementOptions {
  int cascades = 0;
  std::string centre;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("cascades", cascades, Range{0, 8}, "nested boxes; 0 chooses by the kind of capture");
    v("centre", centre, "x,y,z of the box's centre, world units; empty chooses");
  }
};

struct Stage1Options {
  int steps = 5000;
  double max_seconds = 0;
  double least_gain = 0.5;
  int samples_per_step = 65536;
  double learning_rate = 1e-2, final_learning_rate = 5e-4;
  double distortion_weight = 3e-4;
  double depth_weight = 0.01;
  int steps_per_box = 256;
  double cone_angle = 1.0 / 64;
  bool free_space = true;
  bool exposures = true, poses = false, lenses = false;
  bool sky = true;
  int checkpoint_every = 1000;
  int seed = 1;
  HashGridOptions grid = {.decay = 0.1};
  OccupancyOptions occupancy;  // no option of a user's; snapshots keep it
  PlacementOptions placement;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("steps", steps, Range{1, 1e8}, "optimiser steps");
    v("max_seconds", max_seconds, Range{0, 1e9}, "stop after this much training time; 0 = no limit");
    v("least_gain", least_gain, Range{0, 10},
      "dB that a tenth of the steps has to bring on pixels not yet learned from; else the rest is cut short; 0 = "
      "never");
    v("samples_per_step", samples_per_step, Range{1024, 1 << 24},
      "trained samples a step aims at; its number of rays follows from it");
    v("learning_rate", learning_rate, Range{1e-8, 1}, "Adam's step size at the start");
    v("final_learning_rate", final_learning_rate, Range{1e-8, 1},
      "Adam's step size at the end, reached by exponential decay over the last half");
    v("distortion_weight", distortion_weight, Range{0, 10},
      "of a loss on how far apart the samples of a ray lie: against fog and floaters");
    v("depth_weight", depth_weight, Range{0, 10},
      "of a loss on distances that sparse points tell, at the start; it fades");
    v("steps_per_box", steps_per_box, Range{16, 8192}, "march steps across the side of the innermost cascade");
    v("cone_angle", cone_angle, Range{1e-4, 1}, "march step over distance, in scenes of several cascades");
    v("free_space", free_space,
      "space before sparse points is empty; they are found first where a capture has none and nothing else bounds it");
    v("exposures", exposures, "the light of each training view is learned, over that of the median view");
    v("poses", poses, "where cameras stood and looked is learned, from features first, then while training");
    v("lenses", lenses, "focal lengths, principal points and distortion are learned likewise");
    v("sky", sky, "where views see a sky, its light comes from beyond the scene and the way there is empty");
    v("checkpoint_every", checkpoint_every, Range{0, 1e8}, "steps between snapshots; 0 = only at the end");
    v("seed", seed, Range{0, 1e9}, "of weights, rays and jitter");
    v.section("grid", grid);
    v.section("placement", placement);
  }
};

}  // namespace cnerf
