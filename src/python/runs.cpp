/// Runs: training, colouring and baking through the pipeline library.

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <string>
#include <utility>
#include <vector>

#include "bake/camera.h"
#include "src/base/cpu_features.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/parallel.h"
#include "src/base/text.h"
#include "src/config/fields.h"
#include "src/engine/engines.h"
#include "src/pipeline/bake_step.h"
#include "src/pipeline/colorize_step.h"
#include "src/pipeline/default_colorizer.h"
#include "src/pipeline/render_step.h"
#include "src/pipeline/train_step.h"
#include "src/python/bindings.h"
#include "src/python/fields.h"
#include "src/python/steps.h"

namespace cnerf::python {
namespace fs = std::filesystem;
namespace {

using Words = std::vector<std::string>;

/// The text of a value as `--set` takes it.
std::string setting_text(const py::handle& value) {
  if (py::isinstance<py::bool_>(value)) return value.cast<bool>() ? "true" : "false";
  if (!py::isinstance<py::list>(value) && !py::isinstance<py::tuple>(value)) return py::str(value);
  Words items;
  for (const py::handle& item : value) items.push_back(setting_text(item));
  return joined(items, ",");
}

/// What a call changes of a configuration; `key=value` each.
struct Settings {
  std::string preset;
  Words texts;

  /// @param given  any mapping
  Settings(std::string preset_name, const py::object& given) : preset(std::move(preset_name)) {
    for (const auto& [key, value] : py::dict(given)) {
      texts.push_back(std::string(py::str(key)) + "=" + setting_text(value));
    }
  }

  /// @throws UsageError, MissingInputError, DeviceError
  void apply(Config& config) const {
    const std::vector<Field> fields = fields_of(config);
    if (!preset.empty()) {
      const fs::path file = preset_file(preset);
      read_toml(read_text_file(file), file.string(), fields, retired_keys());
    }
    for (const std::string& text : texts) apply_setting(text, fields, retired_keys());
    check_consistency(config);
    (void)engines_for(config.device);  // refuses a device that is not there
    choose_isa(config.kernels);
    if (config.threads > 0) set_thread_count(config.threads);
  }

  /// Without what they are applied to.
  [[nodiscard]] Config alone() const {
    Config named;
    for (const std::string& text : texts) apply_setting(text, fields_of(named), retired_keys());
    return named;
  }

  /// The same on the command line, for records.
  [[nodiscard]] Words command_line(Words words) const {
    if (!preset.empty()) words.insert(words.end(), {"--preset", preset});
    for (const std::string& text : texts) words.insert(words.end(), {"--set", text});
    return words;
  }
};

/// For what says little and takes no time.
class Silent : public Observer {};

class OpenRun {
 public:
  explicit OpenRun(const fs::path& folder, fs::path capture = {})
      : directory_(pipeline::RunDirectory::open(folder)), capture_(std::move(capture)) {}

  [[nodiscard]] const pipeline::RunDirectory& directory() const { return directory_; }

  /// @param take  whose configuration is meant; empty = the run's.  @throws MissingInputError, UsageError, InputError
  [[nodiscard]] pipeline::RunContext context(const std::string& take, const Settings& settings, Words command_line,
                                             Observer& observer) const {
    const pipeline::RunRecord record = directory_.record();
    const std::string name = directory_.root().string();
    if (!record.stage1.finished) {
      throw MissingInputError(name + ": stage 1 is not finished; go on with cnerf.train(..., resume=True)");
    }
    Config config = directory_.config(take, observer);
    settings.apply(config);
    const fs::path where = capture_.empty() ? record.capture : capture_;
    std::error_code failure;
    if (!fs::exists(where, failure)) {
      throw MissingInputError(where.string() + ": no such capture; cnerf.open_run(..., capture=...) says where it is");
    }
    Capture capture = pipeline::read_capture(where, config, observer, directory_.root());
    pipeline::RunContext made{directory_, std::move(config), std::move(capture), std::move(command_line)};
    pipeline::use_learned_views(made, observer);
    return made;
  }

  [[nodiscard]] Words takes() const {
    Words names = directory_.take_names();
    std::erase_if(names, [&](const std::string& name) { return !directory_.take_record(name); });
    return names;
  }

 private:
  pipeline::RunDirectory directory_;
  fs::path capture_;
};

/// What exists already, and may not be replaced unless that is said.
void refuse_existing(const fs::path& file, bool overwrite) {
  std::error_code failure;  // what cannot be looked at is refused where it is written
  if (overwrite || !fs::exists(file, failure)) return;
  throw UsageError(file.string() + ": exists already; overwrite=True replaces it");
}

/// A run's folder is data, whoever made it, but for a colorizer of its configuration that is code.
void refuse_code(const std::string& spec, const std::string& named, bool trust) {
  const bool is_code = spec.starts_with("exec:") || spec.starts_with("torchscript:");
  if (!is_code || trust || named == spec) return;
  throw UsageError("the run's configuration names the colorizer " + spec +
                   ", which would run with your rights; trust=True runs it, colorizer=... names another");
}

struct TrainCall {
  fs::path capture, out;
  Settings settings;
  pipeline::ExistingOutput existing;
};

void train(const TrainCall& call, Observer& observer) {
  const pipeline::RunDirectory directory(call.out);
  Config config = call.existing.resume && directory.exists() ? directory.config("", observer) : Config{};
  call.settings.apply(config);
  const Words words = call.settings.command_line({"cnerf", "train", call.capture.string(), "-o", call.out.string()});
  const Engines& engines = engines_for(config.device);
  Capture capture = pipeline::read_capture(call.capture, config, observer, call.out);
  const pipeline::RunContext context{directory, config, std::move(capture), words};
  const FolderLock lock = pipeline::claim_run_folder(directory, call.existing, observer);
  pipeline::begin_run(context, call.capture, call.existing);
  pipeline::train_step(context, {call.existing.resume}, engines, observer);
}

struct ColorizeCall {
  std::string colorizer, take;
  Settings settings;
  bool trust = false;
  pipeline::ExistingOutput existing;
};

std::string colorize(const OpenRun& run, const ColorizeCall& call, Observer& observer) {
  const std::string base = pipeline::configured_take(run.directory(), call.take, call.existing.resume);
  const Words words = call.settings.command_line({"cnerf", "colorize", run.directory().root().string()});
  pipeline::RunContext context = run.context(base, call.settings, words, observer);
  std::string& spec = context.config.colorizer.spec;
  if (base.empty()) pipeline::prefer_key_frames(call.settings.alone().colorizer, context.config.colorizer);
  if (!call.colorizer.empty()) spec = call.colorizer;
  refuse_code(spec, call.colorizer.empty() ? call.settings.alone().colorizer.spec : call.colorizer, call.trust);
  const Engines& engines = engines_for(context.config.device);
  pipeline::choose_colorizer(context.capture, context.config, observer);
  std::string take = pipeline::take_to_write(context, call.take, call.existing);
  pipeline::colorize_step(context, {take, call.existing}, engines, observer);
  return take;
}

struct BakeCall {
  fs::path folder;
  std::string take, format;
  Settings settings;
  bool overwrite = false;
};

fs::path bake(const OpenRun& run, const BakeCall& call, Observer& observer) {
  const exporting::Formats formats = exporting::parse_formats(call.format);
  const std::string take = run.directory().choose_take(call.take);
  fs::path folder = call.folder.empty() ? run.directory().bakes(take) : call.folder;
  for (const fs::path& file : pipeline::whole_bakes(folder, formats)) refuse_existing(file, call.overwrite);
  const Words words = call.settings.command_line({"cnerf", "bake", run.directory().root().string()});
  const pipeline::RunContext context = run.context(take, call.settings, words, observer);
  pipeline::bake_step(context, {take, folder, formats}, engines_for(context.config.device), observer);
  return folder;
}

std::unique_ptr<OpenScene> open_scene(const OpenRun& run, const std::string& wanted, const Settings& settings) {
  Silent observer;
  const std::string take = run.directory().choose_take(wanted);
  Config config = run.directory().config(take, observer);
  settings.apply(config);
  return std::make_unique<OpenScene>(
      OpenScene{pipeline::load_scene(run.directory(), take, config.finish, engines_for(config.device)), take,
                pipeline::render_options(config)});
}

void bind_steps(py::class_<OpenRun>& run) {
  run.def(
      "colorize",
      [](const OpenRun& self, const std::string& colorizer, const std::string& take, const py::object& settings,
         bool trust, bool resume, const py::object& progress) {
        const ColorizeCall call{colorizer, take, Settings("", settings), trust, {.resume = resume}};
        std::string name;
        run_step(progress, [&](Observer& observer) { name = colorize(self, call, observer); });
        return name;
      },
      py::arg("colorizer") = "", py::kw_only(), py::arg("take") = "", py::arg("settings") = py::dict(),
      py::arg("trust") = false, py::arg("resume") = false, py::arg("progress") = py::none(),
      "Colours the run, as `cnerf colorize` does. Returns the name of the take.");
  run.def(
      "bake",
      [](const OpenRun& self, const fs::path& folder, const std::string& take, const std::string& format,
         const py::object& settings, bool overwrite, const py::object& progress) {
        const BakeCall call{folder, take, format, Settings("", settings), overwrite};
        fs::path made;
        run_step(progress, [&](Observer& observer) { made = bake(self, call, observer); });
        return made;
      },
      py::arg("folder") = "", py::kw_only(), py::arg("take") = "", py::arg("format") = "vdb",
      py::arg("settings") = py::dict(), py::arg("overwrite") = false, py::arg("progress") = py::none(),
      "Bakes a take, as `cnerf bake` does. Returns the folder.");
}

}  // namespace

void bind_runs(py::module_& module) {
  py::class_<OpenRun> run(module, "Run", "The folder of a run. Made by open_run and train.");
  run.def_property_readonly("folder", [](const OpenRun& self) { return self.directory().root(); })
      .def_property_readonly("takes", &OpenRun::takes, "Names of the finished takes.")
      .def_property_readonly(
          "current_take", [](const OpenRun& self) { return self.directory().record().current_take; },
          "The take coloured last; empty = none.")
      .def_property_readonly(
          "cameras",
          [](const OpenRun& self) {
            Silent observer;
            return bake::cameras_of(self.context("", Settings("", py::dict()), {}, observer).capture);
          },
          "The capture's cameras as the training left them. Reads the capture.")
      .def(
          "scene",
          [](const OpenRun& self, const std::string& take, const py::object& settings) {
            const Settings chosen("", settings);
            const py::gil_scoped_release release;
            return open_scene(self, take, chosen);
          },
          py::arg("take") = "", py::kw_only(), py::arg("settings") = py::dict(),
          "The trained field with the colours of a take: the current one, or \"grey\" for none.");
  bind_steps(run);
  module.def(
      "open_run", [](const fs::path& folder, const fs::path& capture) { return OpenRun(folder, capture); },
      py::arg("folder"), py::arg("capture") = "", "Opens a run; `capture` says where its capture lies now.");
  module.def(
      "train",
      [](const fs::path& capture, const fs::path& out, const std::string& preset, const py::object& settings,
         bool resume, bool overwrite, const py::object& progress) {
        const TrainCall call{capture, out, Settings(preset, settings), {resume, overwrite}};
        run_step(progress, [&](Observer& observer) { train(call, observer); });
        return OpenRun(out, capture);
      },
      py::arg("capture"), py::arg("out"), py::kw_only(), py::arg("preset") = "", py::arg("settings") = py::dict(),
      py::arg("resume") = false, py::arg("overwrite") = false, py::arg("progress") = py::none(),
      "Trains a run from a capture, as `cnerf train` does.");
}

}  // namespace cnerf::python
