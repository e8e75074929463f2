#pragma once
/// The folder of a run and what lies where in it:
///
///   config.toml          every option the run was made with
///   run.json             capture, program version, how far stage 1 came, the current take
///   stage1.snapshot      luminance and density
///   takes/NAME/          one colorization each: take.snapshot, take.json, config.toml, galleries, metrics.json
///   cache/               what a colorizer learnt, by content; may be deleted
///   renders/NAME/        pictures and videos of a take ("grey": of none)
///   bakes/NAME/          volumes of a take
///   metrics.json, contact_sheet.png   of the take evaluated last
///   bases.png            base candidates, when only those were asked for
///   key_views.png, key_views.json     suggested key frames, when those were asked for
///   strokes/             what was painted in the studio

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "src/base/json_record.h"
#include "src/base/observer.h"
#include "src/base/usage.h"
#include "src/config/config.h"
#include "src/engine/engines.h"
#include "src/train/chroma/stage2.h"
#include "src/train/luminance/stage1.h"
#include "src/train/scene.h"

namespace cnerf::pipeline {

inline constexpr int kRunSchemaVersion = 1;
inline constexpr const char* kGreyTake = "grey";  ///< names the outputs of an uncoloured scene

struct Stage1Record : Stage1Report {
  bool finished = false;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("finished", self.finished);
    v("steps", self.steps);
    v("seconds", self.seconds);
    v("trained_samples", self.trained_samples);
    v("train_psnr", self.train_psnr);
    v("sky_views", self.sky_views, kLater);
    v("sky_share", self.sky_share, kLater);
  }
};

/// Content of run.json.
struct RunRecord {
  int schema_version = kRunSchemaVersion;
  std::string program_version;
  std::string command_line;                        ///< that started the run
  std::filesystem::path capture;                   ///< absolute
  std::string current_take;                        ///< colorized last; empty = none yet
  std::map<std::string, double> seconds_of_steps;  ///< evaluate, bake, render: what each took last
  std::size_t peak_memory_bytes = 0;               ///< the most any step's process held
  Stage1Record stage1;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("schema_version", self.schema_version);
    v("program_version", self.program_version);
    v("command_line", self.command_line);
    v("capture", self.capture);
    v("current_take", self.current_take);
    v("seconds_of_steps", self.seconds_of_steps);
    v("peak_memory_bytes", self.peak_memory_bytes);
    v("stage1", self.stage1);
  }
};

/// Content of takes/NAME/take.json; the file exists once the take is finished.
struct TakeRecord {
  std::string name;
  std::string colorizer;
  Stage2Report stage2;
  double acceptance_rate = 0;  ///< of the colorizer's answers; follows from `stage2` when the record is saved
  int schema_version = kRunSchemaVersion;
  std::string program_version = {};

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("schema_version", self.schema_version);
    v("program_version", self.program_version);
    v("name", self.name);
    v("colorizer", self.colorizer);
    v("accepted_patches", self.stage2.accepted);
    v("rejected_patches", self.stage2.rejected);
    v("acceptance_rate", self.acceptance_rate);
    v("seconds", self.stage2.seconds);
    v("colorizer_seconds", self.stage2.colorizer_seconds);
    v("waited_seconds", self.stage2.waited_seconds, kOptional);
    v("bake_ab_distance", self.stage2.bake_ab_distance);
  }
};

class RunDirectory {
 public:
  explicit RunDirectory(std::filesystem::path root) : root_(std::move(root)) {}

  /// A folder that holds a run.  @throws MissingInputError  when it does not; SnapshotError for a newer run.json.
  static RunDirectory open(const std::filesystem::path& root);

  [[nodiscard]] const std::filesystem::path& root() const { return root_; }
  [[nodiscard]] std::filesystem::path config_file() const { return root_ / "config.toml"; }
  [[nodiscard]] std::filesystem::path record_file() const { return root_ / "run.json"; }
  [[nodiscard]] std::filesystem::path stage1_snapshot() const { return root_ / "stage1.snapshot"; }
  [[nodiscard]] std::filesystem::path metrics_file() const { return root_ / "metrics.json"; }
  [[nodiscard]] std::filesystem::path contact_sheet() const { return root_ / "contact_sheet.png"; }
  [[nodiscard]] std::filesystem::path take_folder(const std::string& take) const { return root_ / "takes" / take; }
  [[nodiscard]] std::filesystem::path take_snapshot(const std::string& take) const;
  [[nodiscard]] std::filesystem::path take_record_file(const std::string& take) const;
  [[nodiscard]] std::filesystem::path take_config_file(const std::string& take) const;
  [[nodiscard]] std::filesystem::path colorizer_cache() const { return root_ / "cache"; }
  [[nodiscard]] std::filesystem::path renders(const std::string& take) const;
  [[nodiscard]] std::filesystem::path bakes(const std::string& take) const;

  [[nodiscard]] bool exists() const;
  [[nodiscard]] RunRecord record() const;
  void save(RunRecord record) const;
  /// Reads, changes and saves the record as one, whoever else does so at the same time.
  void update(const std::function<void(RunRecord&)>& change) const;
  /// Of all takes, finished or not, in order.
  [[nodiscard]] std::vector<std::string> take_names() const;
  [[nodiscard]] std::optional<TakeRecord> take_record(const std::string& take) const;
  void save(TakeRecord record) const;

  /// The configuration of the run, or of one of its takes.
  /// @param observer  is told what it says that is no option any more
  [[nodiscard]] Config config(const std::string& take, Observer& observer) const;
  /// A take the user names, or the current one, or "" when the run is not colorized.
  /// @throws MissingInputError  when the named take is not finished; lists those that are.
  [[nodiscard]] std::string choose_take(const std::string& wanted) const;
  /// `base`, or `base-2`, `base-3`, … where no take of that name exists.
  [[nodiscard]] std::string free_take_name(const std::string& base) const;
  /// Removes what a run writes, but for the cache and strokes, which are a person's work; and nothing else.
  void clear() const;

 private:
  std::filesystem::path root_;
};

/// The trained scene of a run.
/// @param take  empty = luminance only.  @throws MissingInputError, SnapshotError.
[[nodiscard]] std::unique_ptr<Scene> load_scene(const RunDirectory& directory, const std::string& take,
                                                const Finish& finish, const Engines& engines);

/// The scene that a step works on: one that is loaded already, or its own.
class StepScene {
 public:
  /// @param loaded  may be null  @throws as load_scene
  StepScene(const Scene* loaded, const RunDirectory& directory, const std::string& take, const Finish& finish,
            const Engines& engines)
      : own_(loaded != nullptr ? nullptr : load_scene(directory, take, finish, engines)),
        scene_(loaded != nullptr ? loaded : own_.get()) {}
  [[nodiscard]] const Scene& operator*() const { return *scene_; }
  [[nodiscard]] const Scene* operator->() const { return scene_; }

 private:
  std::unique_ptr<Scene> own_;
  const Scene* scene_;
};

/// Who coloured a take; empty when nobody did.
[[nodiscard]] std::string colorizer_name(const RunDirectory& directory, const std::string& take);

/// Keeps in the run's record how long a step took.
void note_time(const RunDirectory& directory, const char* step, const Stopwatch& watch);

/// Take names become folder names.  @throws UsageError  when `name` is empty, `.`-led or holds other characters than
/// letters, digits, `-`, `_` and `.`.
void check_take_name(const std::string& name);

}  // namespace cnerf::pipeline
