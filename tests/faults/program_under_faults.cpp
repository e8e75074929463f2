#include "tests/faults/program_under_faults.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <thread>

#include "src/base/pointers_to.h"

extern char** environ;

namespace cnerf::faults {
namespace fs = std::filesystem;
namespace {
using Json = nlohmann::json;

std::string text_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

void replace_all(std::string& text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size())) {
    text.replace(at, from.size(), to);
  }
}

/// Our environment without faults of its own, and those of the plan.
std::vector<std::string> environment_of(const Subject& subject, const fs::path& folder, const Plan& plan) {
  std::vector<std::string> all;
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const std::string_view text = *variable;
    if (text.starts_with("CNERF_FAULT_") || text.starts_with("LD_PRELOAD=") ||
        text.starts_with("CUDA_VISIBLE_DEVICES="))
      continue;
    all.emplace_back(text);
  }
  all.emplace_back("CUDA_VISIBLE_DEVICES=");  // resuming is bit for bit on processors
  if (plan.kind.empty()) return all;
  all.push_back("LD_PRELOAD=" + subject.shim.string());
  all.push_back("CNERF_FAULT_KIND=" + plan.kind);
  all.push_back("CNERF_FAULT_AT=" + (plan.at_end ? "end" : std::to_string(plan.at)));
  all.push_back("CNERF_FAULT_MS=" + std::to_string(plan.milliseconds));
  all.push_back("CNERF_FAULT_ROOT=" + (folder / "root").string());
  all.push_back("CNERF_FAULT_LOG=" + (folder / "operations").string());
  all.push_back("CNERF_FAULT_SHADOW=" + (folder / "shadow").string());
  return all;
}

pid_t start(std::vector<std::string> words, std::vector<std::string> environment, const fs::path& output) {
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, output.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_APPEND,
                                     0600);
  ::posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  posix_spawnattr_t attributes;
  ::posix_spawnattr_init(&attributes);
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  pid_t child = -1;
  const int failure = ::posix_spawn(&child, words.front().c_str(), &actions, &attributes, pointers_to(words).data(),
                                    pointers_to(environment).data());
  ::posix_spawn_file_actions_destroy(&actions);
  ::posix_spawnattr_destroy(&attributes);
  if (failure != 0) throw std::runtime_error(words.front() + ": " + std::strerror(failure));
  return child;
}

void drop_varying(Json& json) {
  if (json.is_object()) {
    for (const std::string& key : varying_keys()) json.erase(key);
    const auto name = json.find("name");
    // The first holds an identifier of its own, the second the name of its folder.
    if (name != json.end() && (*name == "volume.vdb" || *name == "blender_setup.py")) json.erase("sha256");
  }
  if (json.is_structured()) {
    for (Json& part : json) drop_varying(part);
  }
}

/// Short, and the same for the same text.
std::string digest(const std::string& text) {
  return std::to_string(text.size()) + " bytes, hash " + std::to_string(std::hash<std::string>()(text));
}

/// How a report of times ends when it is whole; the times themselves differ. Empty for what is no such report.
std::string ending_of_times(const fs::path& file) {
  if (file.extension() == ".curve" || file.filename() == "table.md") return "\n";
  if (file.filename() == "stage1.txt") return " training pixels\n";
  if (file.filename() == "report.html") return "</html>\n";
  return "";
}

/// What has to be the same in every run that did the same.
std::string lasting(const fs::path& file, std::string text) {
  const std::string extension = file.extension().string();
  if (file.filename() == "accepted.png" || file.filename() == "rejected.png") return "gallery";
  if (const std::string ending = ending_of_times(file); !ending.empty()) {
    return text.ends_with(ending) ? "whole" : "cut short, " + digest(text);
  }
  constexpr std::size_t kIdentifier = 8 + 4 + 8 + 1, kIdentifierBytes = 36;
  if (extension == ".vdb" && text.size() > kIdentifier + kIdentifierBytes) {
    text.replace(kIdentifier, kIdentifierBytes, kIdentifierBytes, '-');
  }
  for (char slot = '0'; slot <= '9'; ++slot) replace_all(text, std::string("slot-") + slot, "slot-*");
  if (extension == ".json") {
    Json json = Json::parse(text, nullptr, false);
    if (json.is_discarded()) return kNoJson + digest(text);
    drop_varying(json);
    return digest(json.dump());
  }
  return digest(text);
}

}  // namespace

Slot::Slot(const fs::path& scratch, int number)
    : scratch_(fs::absolute(scratch)), folder_(scratch_ / ("slot-" + std::to_string(number))) {
  clear();
}

void Slot::clear() const {
  fs::remove_all(folder_);
  fs::create_directories(root());
  fs::create_directories(folder_ / "shadow");
}

Ending Slot::run(const Subject& subject, const std::vector<std::string>& words, const Plan& plan, const Stop& stop,
                 const std::string& output) const {
  std::vector<std::string> all = {subject.program.string()};
  for (std::string word : words) {
    if (word.starts_with("@")) word.replace(0, 1, root().string());
    all.push_back(std::move(word));
  }
  const auto begin = std::chrono::steady_clock::now();
  const auto seconds = [&] { return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(); };
  const pid_t child = start(all, environment_of(subject, folder_, plan), folder_ / output);
  Ending ending;
  int status = 0;
  while (::waitpid(child, &status, WNOHANG) == 0) {
    if (stop.is_time && !ending.was_stopped && stop.is_time(seconds())) {
      ::kill(child, stop.signal);
      ending.was_stopped = true;
    }
    if (seconds() > double(subject.patience.count())) {
      ::kill(-child, SIGKILL);
      ending.hung = true;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  ::kill(-child, SIGKILL);  // children of a killed program
  ending.seconds = seconds();
  ending.code = WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  ending.said = text_of(folder_ / output);
  return ending;
}

std::vector<Slot::Operation> Slot::operations() const {
  std::vector<Operation> all;
  std::ifstream in(folder_ / "operations");
  std::string number;
  for (Operation one; in >> number >> one.what >> one.bytes && std::getline(in >> std::ws, one.path);)
    all.push_back(one);
  return all;
}

fs::path Slot::keep(const std::string& name, const std::string& text) const {
  const fs::path to = scratch_ / "violations" / name;
  fs::create_directories(to.parent_path());
  fs::remove_all(to);
  fs::rename(folder_, to);
  std::ofstream(to / "what.txt") << text;
  clear();
  return to;
}

const std::vector<std::string>& varying_keys() {
  static const std::vector<std::string> keys = {"seconds",        "seconds_of_steps", "colorizer_seconds",
                                                "waited_seconds", "command_line",     "peak_memory_bytes",
                                                "train_psnr",     "stage1_curve",     "stage2_curve"};
  return keys;
}

Content content_of(const fs::path& folder) {
  Content content;
  if (!fs::exists(folder)) return content;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_directory()) continue;
    content[fs::relative(entry.path(), folder).generic_string()] = lasting(entry.path(), text_of(entry.path()));
  }
  return content;
}

std::string difference(const Content& found, const Content& expected) {
  std::string names;
  for (const auto& [name, content] : expected) {
    const auto same = found.find(name);
    if (same == found.end()) {
      names += " missing " + name;
    } else if (same->second != content) {
      names += " other " + name;
    }
  }
  for (const auto& [name, content] : found) {
    if (!expected.contains(name)) names += " additional " + name;
  }
  return names;
}

std::string leftovers(const Content& content) {
  std::string names;
  for (const auto& [name, unused] : content) {
    const std::string file = fs::path(name).filename().string();
    if (file.starts_with(".") || file.ends_with(".bake")) names += " " + name;
  }
  return names;
}

}  // namespace cnerf::faults
