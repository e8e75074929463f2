#pragma once
/// Options that several commands share.

#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <vector>

#include "src/app/reporter.h"
#include "src/config/config.h"
#include "src/config/fields.h"
#include "viewer/server/live_session.h"

namespace cnerf::app {

/// Everything on the command line that says something about the configuration. Later ones win: preset, file, --set,
/// short forms.
struct ConfigArguments {
  std::string preset, file;
  std::vector<std::string> settings;     ///< of --set
  std::vector<std::string> short_forms;  ///< "--downscale 2" as "capture.downscale=2"
  std::string progress = "auto";
  bool is_trusting = false;  ///< whoever made the run folder, whose colorizer is code
};

/// Declares --preset, --config, --set, --device, --threads, --max-memory, --image-memory, --progress and --quiet.
void add_config_options(CLI::App& app, ConfigArguments& arguments);
/// Declares --progress and its short form --quiet.
void add_progress_options(CLI::App& app, std::string& progress);
/// Declares `option` as a short form of the config key `key`, which brings its help and what is legal along.
void add_short_form(CLI::App& app, ConfigArguments& arguments, const std::string& option, const std::string& key);
/// The same for a key that is true or false: the option sets it.
void add_flag_form(CLI::App& app, ConfigArguments& arguments, const std::string& option, const std::string& key);
/// The same for a key that holds a list separated by `;`: the option may be repeated.
void add_list_form(CLI::App& app, ConfigArguments& arguments, const std::string& option, const std::string& key);
/// Declares --colorizer, --trust, --prompt, --keyframe, --hint, --palette, --hint-image and --strokes.
void add_colorizer_options(CLI::App& app, ConfigArguments& arguments);
/// Declares --port, --host, --token, --token-file and --no-browser.
void add_browser_options(CLI::App& app, web::BrowserOptions& options);
/// Declares one option a field, named like the field with `-` for `_`; legal values and defaults go to the help. A bool
/// becomes a flag that sets it.
/// @param fields  must outlive the parsing.
void add_field_options(CLI::App& app, const std::vector<Field>& fields);

/// Reads the arguments over fields: the preset, the file, --set and short forms.
/// @throws UsageError, MissingInputError
void read_settings(const ConfigArguments& arguments, const std::vector<Field>& fields,
                   const std::vector<RetiredKey>& retired);
/// `base` changed by the arguments, checked; also sets the number of threads and refuses a device that is not there.
/// @throws UsageError, MissingInputError, DeviceError.
[[nodiscard]] Config resolve_config(const ConfigArguments& arguments, Config base = {});

/// What the command line itself sets, presets and files that it names included.
[[nodiscard]] Config named_on_command_line(const ConfigArguments& arguments);

/// A run's folder is data, whoever made it, but for the colorizer that its configuration may name.
/// @throws UsageError  where that one runs a program or a script, and the user neither named it nor passed --trust.
void refuse_colorizer_of_others(const ConfigArguments& arguments, const Config& config);

[[nodiscard]] Reporter make_reporter(const ConfigArguments& arguments);

}  // namespace cnerf::app
