#pragma once
/// What a user says about colours: which colorizer, and what is known already.

#include <string>

#include "src/base/options.h"

namespace cnerf {

struct ColorizerOptions {
  std::string spec;  // empty = none given
  std::string keyframes, hint_images, hints, strokes, palette, prompt;
  double timeout_seconds = 60;
  int reference_steps = 480;
  bool reference_on_builtin = true;
  std::string reference_encoder = "auto";

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("spec", spec,
      "builtin, reference:IMAGE..., torchscript:FILE, onnx:FILE, caffe:PROTO,MODEL, exec:COMMAND or grey");
    v("keyframes", keyframes, "painted frames of the capture, VIEW=FILE;...");
    v("hint_images", hint_images, "pictures that are transparent except for strokes, VIEW=FILE;...");
    v("hints", hints, "dots of colour, x,y,VIEW,#rrggbb;... in pixels of the view's image file");
    v("palette", palette, "words that hints and strokes may name instead of a colour, WORD=#rrggbb,...");
    v("strokes", strokes, "what was painted in the studio: the file RUN/strokes/strokes.json");
    v("prompt", prompt, "a text for colorizers that take one: exec: commands with {prompt} in them");
    v("timeout_seconds", timeout_seconds, Range{0.1, 1e6},
      "a colorizer by exec:, torchscript: or ONNX Runtime that takes longer for a batch failed; so did reading a "
      "network");
    v("reference_steps", reference_steps, Range{1, 1e6}, "optimiser steps of the fit to a reference: photograph");
    v("reference_on_builtin", reference_on_builtin, "a reference: fit builds on the built-in network's answer");
    v("reference_encoder", reference_encoder, Choice{"auto", "on", "off"},
      "a reference: fit builds on an image encoder too, which is installed apart; auto: where it is there");
  }
};

}  // namespace cnerf
