#include "tests/faults/campaigns.h"

#include <signal.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <thread>
#include <utility>

namespace cnerf::faults {
namespace fs = std::filesystem;
namespace {

constexpr int kOutput = 73, kBusy = 75, kInternal = 70;
const std::set<int> kDocumented = {0, 64, 65, 66, 69, 71, 73, 75, 76, 77, 78, 79, 130};

/// What one trial found out.
struct Verdict {
  std::string ending;
  std::vector<std::string> violations;  ///< "what: how"
  void violated(const std::string& what, const std::string& how) { violations.push_back(what + ": " + how); }
};

/// A trial: its row, and what is done in a slot.
struct Trial {
  std::string row, name;
  std::function<Verdict(const Slot&)> work;
};

std::string first_word(const std::string& text) {
  return text.substr(0, text.find(':'));
}

/// Runs the trials of this part, `jobs` at a time, and collects what they say.
Report judged(const CampaignOptions& options, const std::vector<Trial>& all) {
  std::vector<Trial> trials;
  for (std::size_t i = std::size_t(options.part) - 1; i < all.size(); i += std::size_t(options.parts)) {
    trials.push_back(all[i]);
  }
  Report report;
  std::mutex mutex;
  std::atomic<std::size_t> next{0};
  const auto work = [&](int number) {
    const Slot slot(options.scratch, number);
    for (std::size_t i = next++; i < trials.size(); i = next++) {
      const Trial& trial = trials[i];
      Verdict verdict;
      try {
        verdict = trial.work(slot);
      } catch (const std::exception& failure) {
        verdict.violated("campaign", failure.what());
      }
      std::string where;
      if (!verdict.violations.empty()) {
        std::ostringstream text;
        text << trial.row << ", " << trial.name << ", seed " << options.seed << "\n";
        for (const std::string& violation : verdict.violations) text << violation << "\n";
        where = slot.keep(std::to_string(i), text.str()).string();
      }
      const std::lock_guard guard(mutex);
      Tally& tally = report.rows[trial.row];
      ++tally.trials;
      ++tally.endings[verdict.ending];
      for (const std::string& violation : verdict.violations) {
        ++tally.violations[first_word(violation)];
        report.violations.push_back({trial.row + ", " + trial.name, violation, where});
      }
      if (!options.is_quiet) {
        std::fprintf(stderr, "\r%zu of %zu trials, %zu violations ", i + 1, trials.size(), report.violations.size());
      }
    }
  };
  std::vector<std::thread> threads;
  for (int number = 0; number < options.jobs; ++number) threads.emplace_back(work, number);
  for (std::thread& thread : threads) thread.join();
  if (!options.is_quiet) std::fputc('\n', stderr);
  return report;
}

/// What a command leaves when nothing disturbs it, and before it.
struct World {
  Content before, after;
  double seconds = 0;
};

World world_of(const CampaignOptions& options, const Fixtures& fixtures, const Command& command,
               const Stop& stop = {}) {
  const Slot slot(options.scratch, 8);
  fixtures.lay_out(slot, command);
  World world;
  world.before = content_of(slot.root());
  const Ending ending = slot.run(options.subject, command.words, {}, stop);
  if (ending.code != 0) {
    throw std::runtime_error(command.name + " ends with " + std::to_string(ending.code) +
                             " undisturbed: " + ending.said);
  }
  world.after = content_of(slot.root());
  world.seconds = ending.seconds;
  return world;
}

/// Files that a command keeps writing anew while it works, so that an older whole one is as good; `info`, the same
/// command and others have to be able to read them at any time.
bool grows(const std::string& file) {
  const std::string name = fs::path(file).filename().string();
  static const std::set<std::string> names = {"stage1.snapshot", "take.snapshot", "stage1.seconds.json",
                                              "run.json",        "take.json",     "take.seconds.json",
                                              "unfinished.bake", "prepare.json"};
  return names.contains(name) || name.starts_with(".") || name.ends_with(".log");
}

std::string last_line(const std::string& text) {
  std::istringstream lines(text);
  std::string last;
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty()) last = line;
  }
  return last;
}

/// Nothing half-written is there under a final name, and what is there can be read or is refused properly.
void judge_what_is_there(const CampaignOptions& options, const Slot& slot, const Command& command, const World& world,
                         Verdict& verdict) {
  for (const auto& [name, content] : content_of(slot.root())) {
    const auto before = world.before.find(name), after = world.after.find(name);
    const bool is_old = before != world.before.end() && before->second == content;
    const bool is_done = after != world.after.end() && after->second == content;
    if (is_old || is_done) continue;
    if (content.starts_with(kNoJson) && !fs::path(name).filename().string().starts_with(".")) {
      verdict.violated("half-written", name + " is no JSON");
    } else if (!grows(name) && after != world.after.end()) {
      verdict.violated("half-written", name + " is neither the old one nor the finished one, but " + content);
    }
  }
  for (const std::string& what : command.info) {
    if (!fs::exists(slot.root() / what)) continue;
    const Ending info = slot.run(options.subject, {"info", "@/" + what});
    if (info.hung || info.code == kInternal || !kDocumented.contains(info.code)) {
      verdict.violated("info", "of " + what + " ends with " + std::to_string(info.code) + ": " + last_line(info.said));
    }
    const bool is_capture = command.name == "sample" || command.name == "prepare";
    const bool lacks_poses = info.said.find("not known yet") != std::string::npos;  // photographs, and no capture
    if (info.code == 0 && is_capture && !lacks_poses) {
      const std::string other = difference(content_of(slot.root() / what), [&] {
        Content expected;
        for (const auto& [name, content] : world.after) {
          if (name.starts_with(what + "/")) expected[name.substr(what.size() + 1)] = content;
        }
        return expected;
      }());
      std::string missing;  // hidden files are no part of it
      std::istringstream words(other);
      for (std::string kind, name; words >> kind >> name;) {
        if (!fs::path(name).filename().string().starts_with(".")) missing += " " + kind + " " + name;
      }
      if (!missing.empty() && missing.find("images/") != std::string::npos) {
        verdict.violated("accepted", "info takes an unfinished capture:" + missing);
      }
    }
  }
}

/// The same command again, as the program says: plain, then with --resume, then with --overwrite.
Ending again(const CampaignOptions& options, const Slot& slot, const Command& command) {
  Ending ending = slot.run(options.subject, command.words);
  for (const char* option : {"--resume", "--overwrite"}) {
    if (ending.code == 0 || ending.hung) break;
    if (ending.said.find(option) == std::string::npos) continue;
    std::vector<std::string> words = command.words;
    words.emplace_back(option);
    ending = slot.run(options.subject, words);
  }
  return ending;
}

/// A power cut right after the end may bring back what was removed last: the lock's file, which locks nothing by
/// itself, and the journal of a bake that is finished, which the next bake there takes or drops.
bool may_come_back(const std::string& name) {
  const std::string file = fs::path(name).filename().string();
  return file == ".cnerf.lock" || file == "unfinished.bake";
}

/// Where a video cannot be begun, pictures stand in for it, and the program says so.
void forget_videos(Content& content) {
  std::erase_if(content, [](const auto& file) {
    return file.first.ends_with(".mp4") || file.first.find("turntable/frame_") != std::string::npos;
  });
}

void judge_result(const Slot& slot, World world, const std::string& when, const Ending& ending, Verdict& verdict) {
  const Content found = content_of(slot.root());
  const std::string left = leftovers(found);
  if (!left.empty()) verdict.violated("leftovers", when + left);
  Content visible;
  for (const auto& [name, content] : found) {
    if (leftovers({{name, content}}).empty()) visible[name] = content;
  }
  if (ending.said.find("instead of a video") != std::string::npos) {
    forget_videos(visible);
    forget_videos(world.after);
  }
  const std::string other = difference(visible, world.after);
  if (!other.empty()) verdict.violated("different", when + other);
}

/// Judges how a disturbed program ended, what it left, and that the same command then ends as if nothing had been.
void judge_disturbed(const CampaignOptions& options, const Slot& slot, const Command& command, const World& world,
                     const Ending& ending, Verdict& verdict) {
  if (ending.hung) verdict.violated("hang", "for " + std::to_string(ending.seconds) + " s");
  if (ending.code == 0) {
    for (const auto& [name, content] : content_of(slot.root())) {
      if (may_come_back(name)) fs::remove(slot.root() / name);
    }
    judge_result(slot, world, "after exit 0:", ending, verdict);
    return;
  }
  judge_what_is_there(options, slot, command, world, verdict);
  const Ending second = again(options, slot, command);
  if (second.code != 0) {
    verdict.violated("again",
                     "the same command ends with " + std::to_string(second.code) + ": " + last_line(second.said));
    return;
  }
  judge_result(slot, world, "after the same command again:", second, verdict);
}

/// `.stage1.partial-123.snapshot` is written for `stage1.snapshot`.
std::string final_name(const std::string& path) {
  std::string name = fs::path(path).filename().string();
  const std::size_t partial = name.find(".partial-");
  if (!name.starts_with(".") || partial == std::string::npos) return name;
  const std::size_t extension = name.find('.', partial + 1);
  return name.substr(1, partial - 1) + (extension == std::string::npos ? "" : name.substr(extension));
}

void judge_refusal(const Slot::Operation& operation, const Ending& ending, Verdict& verdict) {
  if (ending.code == 0) return;
  if (ending.code != kOutput) {
    verdict.violated("exit", std::to_string(ending.code) + " instead of 73 at " + operation.what + " " +
                                 operation.path + ": " + last_line(ending.said));
    return;
  }
  if (fs::path(operation.path).filename() == ".cnerf.lock") return;  // what it says is for messages only
  const fs::path file = final_name(operation.path);
  // Where a video cannot be begun, its pictures are written instead, into a folder of its name.
  const std::string name = file.extension() == ".mp4" ? file.stem().string() : file.string();
  const bool is_named = ending.said.find(name) != std::string::npos ||
                        ending.said.find(fs::path(operation.path).parent_path().string() + ":") != std::string::npos;
  if (!is_named) verdict.violated("unnamed", operation.path + ": " + last_line(ending.said));
}

const std::vector<std::string> kAllKinds = {"eio", "enospc", "short", "kill", "power", "power-names"};

bool is_power_cut(const std::string& kind) {
  return kind.starts_with("power");
}

std::vector<std::string> kinds_of(const CampaignOptions& options) {
  return options.kinds.empty() ? kAllKinds : options.kinds;
}

/// Whether the kind changes anything at this operation.
bool applies(const std::string& kind, const Slot::Operation& operation) {
  const bool needs_room = operation.what == "create" || operation.what == "write" || operation.what == "mkdir";
  if (kind == "enospc" || kind == "edquot") return needs_room;
  if (kind == "short") return operation.what == "write";
  return true;
}

Trial trial_of_operation(const CampaignOptions& options, const Fixtures& fixtures, const Command& command,
                         const World& world, const std::string& kind, long number) {
  const std::string name = number == 0 ? "at the end" : "operation " + std::to_string(number);
  return {command.name + " | " + kind, name, [=, &fixtures, &options, &world](const Slot& slot) {
            fixtures.lay_out(slot, command);
            Plan plan;
            plan.kind = kind;
            plan.at = number;
            plan.at_end = number == 0;
            const Ending ending = slot.run(options.subject, command.words, plan);
            Verdict verdict;
            verdict.ending = std::to_string(ending.code);
            const bool kills = kind == "kill" || is_power_cut(kind);
            const auto operations = slot.operations();
            if (!kills && long(operations.size()) >= number) {
              judge_refusal(operations[std::size_t(number) - 1], ending, verdict);
            } else if (kills && ending.code != -SIGKILL && ending.code != 0) {
              verdict.violated("exit", std::to_string(ending.code) + ": " + last_line(ending.said));
            }
            judge_disturbed(options, slot, command, world, ending, verdict);
            return verdict;
          }};
}

/// Of a run that counts only.
std::vector<Slot::Operation> counted(const CampaignOptions& options, const Fixtures& fixtures, const Command& command,
                                     const std::string& kind) {
  const Slot slot(options.scratch, 7);
  fixtures.lay_out(slot, command);
  Plan plan;
  plan.kind = kind;
  const Ending ending = slot.run(options.subject, command.words, plan);
  if (ending.code != 0) throw std::runtime_error(command.name + ", counted: " + ending.said);
  return slot.operations();
}

/// Where a stride begins.
long first_of(const CampaignOptions& options, std::mt19937_64& random) {
  return options.every <= 1 ? 1 : 1 + long(random() % std::uint64_t(options.every));
}

void add(Report& report, Report more) {
  report.rows.merge(more.rows);
  report.violations.insert(report.violations.end(), more.violations.begin(), more.violations.end());
  report.remarks.insert(report.remarks.end(), more.remarks.begin(), more.remarks.end());
}

}  // namespace

Report disturb_operations(const CampaignOptions& options) {
  const Fixtures fixtures(options.subject, options.scratch);
  std::mt19937_64 random(options.seed);
  Report report;
  for (const Command& command : fixtures.commands(options.commands)) {
    const World world = world_of(options, fixtures, command);
    const auto operations = counted(options, fixtures, command, "count");
    report.remarks.push_back(command.name + ": " + std::to_string(operations.size()) + " operations");
    std::vector<Trial> trials;
    for (const std::string& kind : kinds_of(options)) {
      for (long number = first_of(options, random); number <= long(operations.size()); number += options.every) {
        // The next one that the kind does anything to.
        while (number <= long(operations.size()) && !applies(kind, operations[std::size_t(number) - 1])) ++number;
        if (number > long(operations.size())) break;
        trials.push_back(trial_of_operation(options, fixtures, command, world, kind, number));
      }
      if (is_power_cut(kind)) trials.push_back(trial_of_operation(options, fixtures, command, world, kind, 0));
    }
    add(report, judged(options, trials));
  }
  return report;
}

Report kill_at_random(const CampaignOptions& options) {
  constexpr int kSlowWrite = 40;  // milliseconds
  const Fixtures fixtures(options.subject, options.scratch);
  std::mt19937_64 random(options.seed);
  std::vector<Command> commands = fixtures.commands(
      options.commands.empty() ? std::vector<std::string>{"train", "colorize", "bake", "prepare", "web", "compare"}
                               : options.commands);
  std::vector<World> worlds;
  for (const Command& command : commands) worlds.push_back(world_of(options, fixtures, command));
  std::vector<Trial> trials;
  for (int i = 0; i < options.count; ++i) {
    const std::size_t which = std::size_t(i) % commands.size();
    const Command& command = commands[which];
    const World& world = worlds[which];
    const bool is_slow = (std::size_t(i) / commands.size()) % 2 == 1;
    const double moment = std::uniform_real_distribution<>(0, 1)(random) * world.seconds;
    const double patience = std::uniform_real_distribution<>(0, 1)(random) * kSlowWrite / 1000;
    trials.push_back({command.name + (is_slow ? " | while it writes slowly" : " | at any time"),
                      "kill " + std::to_string(i) + " after " + std::to_string(moment) + " s",
                      [&, is_slow, moment, patience](const Slot& slot) {
                        fixtures.lay_out(slot, command);
                        Plan plan;
                        if (is_slow) plan.kind = "slow";
                        plan.milliseconds = kSlowWrite;
                        std::optional<double> found;
                        const auto is_time = [&](double seconds) {
                          if (seconds < moment) return false;
                          if (!is_slow) return true;
                          // A file that is being written is there.
                          if (!found) {
                            std::error_code ignored;
                            for (auto entry = fs::recursive_directory_iterator(slot.root(), ignored);
                                 !ignored && entry != fs::recursive_directory_iterator(); entry.increment(ignored)) {
                              if (entry->path().filename().string().find(".partial-") != std::string::npos) {
                                found = seconds;
                                break;
                              }
                            }
                          }
                          return found && seconds >= *found + patience;
                        };
                        const Ending ending = slot.run(options.subject, command.words, plan, {SIGKILL, is_time});
                        Verdict verdict;
                        verdict.ending = std::to_string(ending.code);
                        if (ending.code != 0 && ending.code != -SIGKILL) {
                          verdict.violated("exit", std::to_string(ending.code) + ": " + last_line(ending.said));
                        }
                        judge_disturbed(options, slot, command, world, ending, verdict);
                        return verdict;
                      }});
  }
  return judged(options, trials);
}

namespace {

/// What two commands that ended may have left of each other's files.
void judge_pair(const Content& found, const std::array<const World*, 2>& worlds, const std::array<Ending, 2>& endings,
                Verdict& verdict) {
  const std::string left = leftovers(found);
  if (!left.empty()) verdict.violated("leftovers", left);
  for (const auto& [name, content] : found) {
    const auto is_of = [&, file = name, text = content](const Content& world) {
      const auto same = world.find(file);
      return same != world.end() && same->second == text;
    };
    const bool is_right = is_of(worlds[0]->before) || is_of(worlds[0]->after) || is_of(worlds[1]->after);
    if (!is_right && !grows(name)) verdict.violated("wrong", name + " is of neither");
    if (!is_right && grows(name) && content.starts_with(kNoJson)) verdict.violated("wrong", name + " is no JSON");
  }
  for (std::size_t i = 0; i < 2; ++i) {
    if (endings[i].code != 0) continue;
    const World &own = *worlds[i], &other = *worlds[1 - i];
    const bool other_clears = endings[1 - i].code == 0 && std::ranges::any_of(other.before, [&](const auto& file) {
                                return !other.after.contains(file.first);
                              });
    std::string missing;
    bool is_any_there = false;
    for (const auto& [name, content] : own.after) {
      const auto before = own.before.find(name);
      if (before != own.before.end() && before->second == content) continue;
      const auto same = found.find(name);
      const auto others = other.after.find(name);
      const bool is_own = same != found.end() && same->second == content;
      const bool is_others = endings[1 - i].code == 0 && same != found.end() && others != other.after.end() &&
                             same->second == others->second;
      const bool is_merged = same != found.end() && grows(name);
      if (is_own && !is_others) is_any_there = true;
      if (!is_own && !is_others && !is_merged) missing += " " + name;
    }
    if (!missing.empty() && (is_any_there || !other_clears)) verdict.violated("lost", "after exit 0:" + missing);
  }
}

}  // namespace

Report run_pairs(const CampaignOptions& options) {
  const Fixtures fixtures(options.subject, options.scratch);
  std::mt19937_64 random(options.seed);
  std::vector<Command> commands;
  std::map<std::size_t, World> worlds;  // of commands in pairs that are tried, by their places
  Report report;
  const Stop ctrl_c = {SIGINT, [](double seconds) { return seconds > 3; }};
  for (const Command& command : fixtures.neighbours()) {
    if (!options.commands.empty() && std::ranges::find(options.commands, command.name) == options.commands.end())
      continue;
    try {
      if (command.name == "view") worlds.emplace(commands.size(), world_of(options, fixtures, command, ctrl_c));
    } catch (const std::runtime_error& failure) {
      // Without npm there is no page to be shown.
      if (std::string(failure.what()).find("page was not built") == std::string::npos) throw;
      report.remarks.push_back("view left out: " + last_line(failure.what()));
      continue;
    }
    commands.push_back(command);
  }
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t a = 0; a < commands.size(); ++a) {
    for (std::size_t b = 0; b < commands.size(); ++b) pairs.emplace_back(a, b);
  }
  std::ranges::shuffle(pairs, random);
  std::vector<Trial> trials;
  for (int i = 0; i < options.count; ++i) {
    const auto [a, b] = pairs[std::size_t(i) % pairs.size()];
    for (const std::size_t which : {a, b}) {
      if (!worlds.contains(which)) worlds.emplace(which, world_of(options, fixtures, commands[which]));
    }
    const double offset = std::uniform_real_distribution<>(0, 1)(random) * worlds.at(a).seconds;
    const std::string row = commands[a].name + " + " + commands[b].name;
    trials.push_back(
        {row, std::to_string(offset) + " s later", [&, a = a, b = b, offset](const Slot& slot) {
           fixtures.lay_out(slot, commands[a]);
           const Slot& same = slot;
           std::array<Ending, 2> endings;
           const auto stop = [&](std::size_t which) { return commands[which].name == "view" ? ctrl_c : Stop{}; };
           std::thread first([&] { endings[0] = same.run(options.subject, commands[a].words, {}, stop(a)); });
           std::this_thread::sleep_for(std::chrono::duration<double>(offset));
           endings[1] = same.run(options.subject, commands[b].words, {}, stop(b), "output-2");
           first.join();
           Verdict verdict;
           verdict.ending = std::to_string(endings[0].code) + "+" + std::to_string(endings[1].code);
           for (const Ending& ending : endings) {
             if (ending.hung) verdict.violated("hang", "");
             if (ending.code == kInternal || !kDocumented.contains(ending.code)) {
               verdict.violated("exit", std::to_string(ending.code) + ": " + last_line(ending.said));
             }
             const bool names = ending.said.find("another cnerf") != std::string::npos &&
                                ending.said.find(slot.root().string()) != std::string::npos;
             if (ending.code == kBusy && !names) verdict.violated("unnamed", last_line(ending.said));
           }
           judge_pair(content_of(slot.root()), {&worlds.at(a), &worlds.at(b)}, endings, verdict);
           return verdict;
         }});
  }
  Report more = judged(options, trials);
  more.remarks = report.remarks;
  return more;
}

Report starve(const CampaignOptions& options) {
  const Fixtures fixtures(options.subject, options.scratch);
  std::mt19937_64 random(options.seed);
  std::vector<Command> commands;
  const std::vector<std::string> working = {"bake", "train",  "colorize", "web",    "gltf",
                                            "exr",  "render", "eval",     "sample", "prepare"};
  for (const Command& command : fixtures.readers()) {
    if (options.commands.empty() || std::ranges::find(options.commands, "info") != options.commands.end()) {
      commands.push_back(command);
    }
  }
  for (const Command& command : fixtures.commands(working)) {
    if (options.commands.empty() || std::ranges::find(options.commands, command.name) != options.commands.end()) {
      commands.push_back(command);
    }
  }
  Report report;
  for (const Command& command : commands) {
    const World world = world_of(options, fixtures, command);
    const std::size_t allocations = counted(options, fixtures, command, "memory").size();
    report.remarks.push_back(command.name + ": " + std::to_string(allocations) + " large allocations");
    std::vector<Trial> trials;
    for (long number = first_of(options, random); number <= long(allocations); number += options.every) {
      trials.push_back(
          {command.name + " | memory", "allocation " + std::to_string(number), [&, number](const Slot& slot) {
             fixtures.lay_out(slot, command);
             Plan plan;
             plan.kind = "memory";
             plan.at = number;
             const Ending ending = slot.run(options.subject, command.words, plan);
             Verdict verdict;
             verdict.ending = std::to_string(ending.code);
             if (ending.code != 0 && !options.out_of_memory.contains(ending.code)) {
               verdict.violated("exit", std::to_string(ending.code) + ": " + last_line(ending.said));
             }
             judge_disturbed(options, slot, command, world, ending, verdict);
             return verdict;
           }});
    }
    add(report, judged(options, trials));
  }
  return report;
}

std::string Report::text() const {
  std::ostringstream out;
  out << "| command | fault | trials | endings | violations |\n|---|---|---|---|---|\n";
  int trials = 0;
  for (const auto& [row, tally] : rows) {
    const std::size_t bar = row.find(" | ");
    out << "| " << row.substr(0, bar) << " | " << (bar == std::string::npos ? "" : row.substr(bar + 3)) << " | "
        << tally.trials << " |";
    for (const auto& [ending, count] : tally.endings) out << ' ' << ending << ": " << count << ';';
    out << " |";
    for (const auto& [what, count] : tally.violations) out << ' ' << what << ": " << count << ';';
    out << (tally.violations.empty() ? " 0 |\n" : " |\n");
    trials += tally.trials;
  }
  out << "| all | | " << trials << " | | " << violations.size() << " |\n";
  for (const std::string& remark : remarks) out << "* " << remark << "\n";
  for (const Violation& violation : violations) {
    out << "\nviolation: " << violation.row << "\n  " << violation.what << "\n  kept in " << violation.where << "\n";
  }
  return out.str();
}

}  // namespace cnerf::faults
