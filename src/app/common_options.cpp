#include "src/app/common_options.h"

#include <fmt/format.h>

#include <algorithm>

#include "src/base/check.h"
#include "src/base/cpu_features.h"
#include "src/base/files.h"
#include "src/base/parallel.h"
#include "src/base/text.h"
#include "src/base/usage.h"
#include "src/cluster/ranks.h"
#include "src/config/toml_binding.h"
#include "src/engine/engines.h"

namespace cnerf::app {
namespace {

/// What stands right of `name = ` in TOML.
std::string default_text(const Field& field) {
  const std::string line = write_toml({field});
  const auto begin = line.find(" = ") + 3;
  return line.substr(begin, line.find("  # ") - begin);
}

/// "triangles of the mesh, about [60000; 16 to 1e+08]"
std::string described(const Field& field) {
  std::string legal = joined(field.choices, ", ");
  const char* zero = field.range && field.range->or_zero ? "0, " : "";
  if (field.range) legal = fmt::format("{}{:g} to {:g}", zero, field.range->min, field.range->max);
  if (std::holds_alternative<bool*>(field.value)) return field.help;
  return field.help + " [" + default_text(field) + (legal.empty() ? "" : "; " + legal) + "]";
}

/// What fields say of one of their keys.
std::string help_of(const std::vector<Field>& fields, const std::string& key) {
  const auto field = std::ranges::find(fields, key, &Field::key);
  CNERF_CHECK(field != fields.end(), key);
  return described(*field) + " (" + key + ")";
}

std::string first_line(const std::string& file) {
  const std::string text = read_text_file(file);
  return text.substr(0, text.find_first_of("\r\n"));
}

/// What the configuration says of one of its keys.
std::string help_of(const std::string& key) {
  Config config;
  return help_of(fields_of(config), key);
}

}  // namespace

void add_config_options(CLI::App& app, ConfigArguments& arguments) {
  app.add_option("--preset", arguments.preset, "Set of options to start from: " + joined(preset_names(), ", "));
  app.add_option("--config", arguments.file, "TOML file of options, read over the preset");
  app.add_option("--set", arguments.settings, "One option, key.path=value; may be repeated")
      ->allow_extra_args(false)
      ->take_all();
  add_short_form(app, arguments, "--device", "device");
  add_short_form(app, arguments, "--threads", "threads");
  add_short_form(app, arguments, "--max-memory", "max_memory");
  add_short_form(app, arguments, "--image-memory", "image_memory");
  add_progress_options(app, arguments.progress);
}

void add_progress_options(CLI::App& app, std::string& progress) {
  app.add_option("--progress", progress, "auto, line, plain, json or quiet");
  app.add_flag_callback(
      "--quiet", [&progress] { progress = "quiet"; }, "Print results only: short for --progress quiet");
}

void add_short_form(CLI::App& app, ConfigArguments& arguments, const std::string& option, const std::string& key) {
  Config config;
  app.add_option_function<std::string>(
      option, [&arguments, key](const std::string& value) { arguments.short_forms.push_back(key + "=" + value); },
      help_of(fields_of(config), key));
}

void add_flag_form(CLI::App& app, ConfigArguments& arguments, const std::string& option, const std::string& key) {
  app.add_flag_callback(
      option, [&arguments, key] { arguments.short_forms.push_back(key + "=true"); }, help_of(key));
}

void add_list_form(CLI::App& app, ConfigArguments& arguments, const std::string& option, const std::string& key) {
  app.add_option_function<std::vector<std::string>>(
         option,
         [&arguments, key](const std::vector<std::string>& values) {
           arguments.short_forms.push_back(key + "=" + joined(values, ";"));
         },
         help_of(key) + "; may be repeated")
      ->allow_extra_args(false)
      ->take_all();
}

void add_browser_options(CLI::App& app, web::BrowserOptions& options) {
  app.add_option("--port", options.server.port, "Port of the page; 0 chooses a free one")->check(CLI::Range(0, 65535));
  app.add_option("--host", options.server.host, "Address to listen on; other than this machine's own it needs --token");
  app.add_option(
         "--token", options.server.token,
         "Secret that visitors of the page need, 16 letters or more; others see it in ps, so rather set CNERF_TOKEN")
      ->envname("CNERF_TOKEN");
  app.add_option_function<std::string>(
      "--token-file", [&options](const std::string& file) { options.server.token = first_line(file); },
      "File whose first line is the token");
  app.add_flag("--no-browser", options.no_browser, "Only print the address");
}

void add_colorizer_options(CLI::App& app, ConfigArguments& arguments) {
  add_short_form(app, arguments, "--colorizer", "colorizer.spec");
  app.add_flag("--trust", arguments.is_trusting, "Ask the program or script that the run's own configuration names");
  add_short_form(app, arguments, "--prompt", "colorizer.prompt");
  add_list_form(app, arguments, "--keyframe", "colorizer.keyframes");
  add_list_form(app, arguments, "--hint", "colorizer.hints");
  add_list_form(app, arguments, "--palette", "colorizer.palette");
  add_list_form(app, arguments, "--hint-image", "colorizer.hint_images");
  add_short_form(app, arguments, "--strokes", "colorizer.strokes");
}

void add_field_options(CLI::App& app, const std::vector<Field>& fields) {
  for (const Field& field : fields) {
    std::string name = "--" + field.key;
    std::ranges::replace(name, '_', '-');
    if (std::holds_alternative<bool*>(field.value)) {
      app.add_flag_function(
          name, [field](std::int64_t) { apply_setting(field.key + "=true", {field}); }, field.help);
      continue;
    }
    app.add_option_function<std::string>(
        name, [field](const std::string& value) { apply_setting(field.key + "=" + value, {field}); }, described(field));
  }
}

void read_settings(const ConfigArguments& arguments, const std::vector<Field>& fields,
                   const std::vector<RetiredKey>& retired) {
  const auto read_file = [&](const std::filesystem::path& file) {
    read_toml(read_text_file(file), file.string(), fields, retired);
  };
  if (!arguments.preset.empty()) read_file(preset_file(arguments.preset));
  if (!arguments.file.empty()) read_file(arguments.file);
  for (const std::string& setting : arguments.settings) apply_setting(setting, fields, retired);
  for (const std::string& setting : arguments.short_forms) apply_setting(setting, fields, retired);
}

Config resolve_config(const ConfigArguments& arguments, Config base) {
  read_settings(arguments, fields_of(base), retired_keys());
  check_consistency(base);
  (void)engines_for(base.device);  // refuses a device that is not there
  choose_isa(base.kernels);
  set_thread_count(base.threads > 0 ? base.threads : cluster::world().threads());
  if (!base.max_memory.empty()) limit_memory(base.max_memory);
  return base;
}

Config named_on_command_line(const ConfigArguments& arguments) {
  Config named;
  read_settings(arguments, fields_of(named), retired_keys());
  return named;
}

void refuse_colorizer_of_others(const ConfigArguments& arguments, const Config& config) {
  const std::string& spec = config.colorizer.spec;
  const bool is_code = spec.starts_with("exec:") || spec.starts_with("torchscript:");
  if (!is_code || arguments.is_trusting) return;
  if (named_on_command_line(arguments).colorizer.spec == spec) return;
  throw UsageError("the run's configuration names the colorizer " + printable(spec) +
                   ", which would run with your rights; pass --trust if you know who made the run, or --colorizer");
}

Reporter make_reporter(const ConfigArguments& arguments) {
  if (!cluster::world().is_first()) return Reporter(ProgressStyle::kSilent);  // rank 0 speaks for all
  return Reporter(progress_style(arguments.progress, stdout));
}

}  // namespace cnerf::app
