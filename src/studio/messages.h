#pragma once
/// What the studio's page and its server say to each other, as records. Shares of width and height for places in
/// pictures; cameras as src/capture/camera_record.h has them.

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "src/base/record.h"
#include "src/capture/camera_record.h"
#include "src/studio/field_view.h"
#include "src/train/chroma/strokes.h"

namespace cnerf::studio {

/// POST frame: a camera, and what is shown of it: a JPEG per side, one behind the other. X-Cnerf-Sizes tells their
/// bytes.
struct FrameMessage {
  CameraRecord camera;
  std::vector<std::string> sides;  ///< "" = uncoloured, "now", or a take; "grey" too where no take is called so
  bool moving = false;             ///< somebody moves the camera; else a better or newer picture of where it rests

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    CameraRecord::visit(self.camera, v);
    v("sides", self.sides);
    v("moving", self.moving, kOptional);
  }
};

/// A view of the capture.
struct ViewMessage {
  std::string name;
  bool held_out = false;
  int width = 0, height = 0;
  CameraRecord camera;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("name", self.name);
    v("held_out", self.held_out);
    v("width", self.width);
    v("height", self.height);
    CameraRecord::visit(self.camera, v);
  }
};

/// GET scene.
struct SceneMessage {
  std::string title, run, up;
  Triple centre{};
  double radius = 1;  ///< of what is worth looking at, world units
  std::vector<ViewMessage> views;
  int home = 0;  ///< the view to begin with

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("title", self.title);
    v("run", self.run);
    v("up", self.up);
    v("centre", self.centre);
    v("radius", self.radius);
    v("views", self.views);
    v("home", self.home);
  }
};

struct TakeMessage {
  std::string name, colorizer;
  double seconds = 0;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("name", self.name);
    v("colorizer", self.colorizer);
    v("seconds", self.seconds);
  }
};

struct DownloadMessage {
  std::string name, address;
  std::uint64_t bytes = 0;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("name", self.name);
    v("address", self.address);
    v("bytes", self.bytes);
  }
};

/// A suggestion of colours.
struct CardMessage {
  int number = 0;  ///< as `cnerf colorize --bases` counts
  std::string address;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("number", self.number);
    v("address", self.address);
  }
};

/// A view that is worth painting on.
struct KeyViewMessage {
  int view = 0;     ///< number of the capture's view
  double adds = 0;  ///< share of the scene that it tells of, beside those before it

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("view", self.view);
    v("adds", self.adds);
  }
};

/// What there is to begin with: files that a page has sent, else what the program was called with.
struct ArrivedMessage {
  int files = 0;
  std::uint64_t bytes = 0;
  std::string source;  ///< that the program was called with; empty = none

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("files", self.files);
    v("bytes", self.bytes);
    v("source", self.source);
  }
};

// Stages of a studio.
inline constexpr const char* kPhotographs = "photographs";  ///< there is no capture yet
inline constexpr const char* kTraining = "training";        ///< luminance and density are not trained to the end
inline constexpr const char* kField = "field";

/// GET state, and the news.
struct StateMessage {
  std::uint64_t version = 1, colors = 1;
  std::string stage = kField;
  int scene = 1;     ///< grows when GET scene answers otherwise
  std::string task;  ///< that is worked on; empty = none
  std::string step;  ///< of the task, in words
  double fraction = 0;
  std::vector<std::string> notes;  ///< what the work said lately
  ArrivedMessage arrived;
  Finish finish;
  std::vector<CardMessage> cards;
  std::vector<KeyViewMessage> key_views;  ///< the one to begin with first
  std::map<std::string, double> figures;
  std::string message;
  bool failed = false, ready = false;
  std::string writer;
  int strokes = 0;  ///< revision
  std::string take;
  bool unkept = false;
  std::vector<TakeMessage> takes;
  std::vector<std::string> commands;
  std::vector<DownloadMessage> downloads;
  std::string blender;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("version", self.version);
    v("colors", self.colors);
    v("stage", self.stage);
    v("scene", self.scene);
    v("task", self.task);
    v("step", self.step);
    v("fraction", self.fraction);
    v("notes", self.notes);
    v("arrived", self.arrived);
    v("finish", self.finish);
    v("cards", self.cards);
    v("key_views", self.key_views);
    v("figures", self.figures);
    v("message", self.message);
    v("failed", self.failed);
    v("ready", self.ready);
    v("writer", self.writer);
    v("strokes", self.strokes);
    v("take", self.take);
    v("unkept", self.unkept);
    v("takes", self.takes);
    v("commands", self.commands);
    v("downloads", self.downloads);
    v("blender", self.blender);
  }
};

/// POST orders.
struct OrderMessage {
  std::string order, take, name, format;
  std::vector<std::string> formats;
  std::vector<int> bases;  ///< numbers of the cards that are liked
  Finish finish;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("order", self.order);
    v("take", self.take, kOptional);
    v("name", self.name, kOptional);
    v("format", self.format, kOptional);
    v("formats", self.formats, kOptional);
    v("bases", self.bases, kOptional);
    v("saturation", self.finish.saturation, kOptional);
    v("hue", self.finish.hue, kOptional);
    v("exposure", self.finish.exposure, kOptional);
  }
};

[[nodiscard]] FieldCamera camera_of(const CameraRecord& camera);
/// The camera of a frame that somebody asks for.  @throws InputError  as check_camera
[[nodiscard]] FieldCamera camera_of(const FrameMessage& message);
[[nodiscard]] SceneMessage scene_of(const Capture& capture, const std::string& run);
/// What tells runs apart, however their folders were named when the program was called.
[[nodiscard]] std::string name_of_run(const std::filesystem::path& root);

}  // namespace cnerf::studio
