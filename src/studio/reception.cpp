#include "src/studio/reception.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <utility>

#include "src/base/error.h"
#include "src/base/file_descriptor.h"
#include "src/base/files.h"
#include "src/base/folder_lock.h"
#include "src/base/text.h"
#include "src/pipeline/prepare_step.h"
#include "src/prepare/prepare.h"
#include "src/studio/board_observer.h"

namespace cnerf::studio {
namespace fs = std::filesystem;
using web::PageAnswer;
using web::PageRequest;
using web::refusal;

namespace {

/// The mark of a folder that was made for what arrives, so that nothing else is ever replaced or removed.
constexpr const char* kArrivalsMark = ".cnerf-arrivals";
constexpr std::size_t kMostFiles = 20000, kLongestName = 200, kDeepestName = 6;
constexpr std::uint64_t kLargestFile = std::uint64_t(16) << 30, kMostBytes = std::uint64_t(64) << 30;
constexpr std::array kPhotographKinds = {"jpg", "jpeg", "png", "tif", "tiff", "webp", "exr"};
constexpr std::array kClipKinds = {"mp4", "mov", "mkv", "avi", "webm", "m4v"};
constexpr std::array kCaptureKinds = {"json", "bin", "txt", "npy", "npz", "xml", "csv", "xmp", "ply"};

std::string kind_of(const fs::path& file) {
  std::string kind = file.extension().string();
  std::ranges::transform(kind, kind.begin(), [](unsigned char c) { return char(std::tolower(c)); });
  return kind.empty() ? kind : kind.substr(1);
}

template <std::size_t N>
bool is_one_of(const std::string& kind, const std::array<const char*, N>& kinds) {
  return std::ranges::find(kinds, kind) != kinds.end();
}

bool is_marked(const fs::path& arrivals) {
  std::error_code failure;
  return fs::exists(arrivals / kArrivalsMark, failure);
}

/// @throws UsageError  somebody else put files there
void check_arrivals(const fs::path& arrivals) {
  if (is_marked(arrivals) || is_vacant(arrivals)) return;
  throw UsageError(arrivals.string() +
                   ": is where the page's files would go, but holds others; choose another folder for the run");
}

/// Whether no arrival has such a name: `checked_name` refuses it.
bool is_hidden(const fs::path& file) {
  return file.filename().string().starts_with('.');
}

std::string note_instead_of(const fs::path& source) {
  return "note: what has arrived is taken instead of " + source.string();
}

/// A file's place below the folder of arrivals.  @throws InputError  the name leads out of it, or is no such file's
fs::path checked_name(const std::string& name) {
  const auto refuse = [&](const std::string& why) {
    throw InputError(excerpt(nlohmann::ordered_json(name)), "name", why);
  };
  if (name.empty() || name.size() > kLongestName) refuse(fmt::format("expected 1 to {} characters", kLongestName));
  const bool is_plain = std::ranges::all_of(name, [](unsigned char c) {
    return std::isalnum(c) != 0 || c >= 0x80 || std::string_view(" ._-()+,/").find(char(c)) != std::string_view::npos;
  });
  if (!is_plain || !is_utf8(name)) refuse("expected letters, digits and ._-()+, only, in UTF-8");
  if (name.find("//") != std::string::npos) refuse("a part of it is empty");
  const fs::path path(name);
  std::size_t parts = 0;
  for (const fs::path& part : path) {
    ++parts;
    if (part.empty() || part.string().starts_with('.')) refuse("a part of it is empty, or begins with a dot");
  }
  if (path.is_absolute() || parts > kDeepestName) refuse("expected a path of few parts below the folder");
  const std::string kind = kind_of(path);
  if (!is_one_of(kind, kPhotographKinds) && !is_one_of(kind, kClipKinds) && !is_one_of(kind, kCaptureKinds)) {
    refuse("is no photograph, clip, or part of a capture");
  }
  return path;
}

/// Writes a piece where the file ends, and nowhere else; at 0 it begins the file.
/// @return  the size then; nothing where the file does not end there
/// @throws OutputError  of a file that it began nothing is left
std::optional<std::uint64_t> append(const fs::path& file, std::uint64_t offset, const std::string& piece) {
  std::error_code failure;
  fs::create_directories(file.parent_path(), failure);
  if (failure) throw OutputError(file.string() + ": cannot be written: " + failure.message());
  const int flags = O_WRONLY | O_CLOEXEC | O_NOFOLLOW | (offset == 0 ? O_CREAT | O_TRUNC : 0);
  const FileDescriptor opened(::open(file.c_str(), flags, 0644));
  struct stat state {};
  const auto fail = [&]() -> std::optional<std::uint64_t> {
    throw OutputError(file.string() + ": cannot be written: " + std::strerror(errno));
  };
  if (opened.number() < 0 || ::fstat(opened.number(), &state) != 0) return fail();
  if (!S_ISREG(state.st_mode) || std::uint64_t(state.st_size) != offset) return std::nullopt;
  for (std::size_t done = 0; done < piece.size();) {
    const ssize_t put = ::pwrite(opened.number(), piece.data() + done, piece.size() - done, off_t(offset + done));
    if (put < 0 && errno == EINTR) continue;
    if (put < 0) {
      const int problem = errno;
      (void)!(offset == 0 ? ::unlink(file.c_str()) : ::ftruncate(opened.number(), off_t(offset)));
      errno = problem;
      return fail();
    }
    done += std::size_t(put);
  }
  return offset + piece.size();
}

}  // namespace

Reception::Reception(fs::path source, const fs::path& run, Open open, Observer& observer)
    : source_(std::move(source)),
      run_(fs::absolute(run).lexically_normal()),
      open_(std::move(open)),
      observer_(observer),
      is_ordered_(!source_.empty()) {
  if (run_.filename().empty()) run_ = run_.parent_path();
  arrivals_ = run_.parent_path() / (run_.filename().string() + "-photographs");
  if (source_.empty()) check_arrivals(arrivals_);
  board_.change([](StateMessage& state) { state.stage = kPhotographs; });
  count_arrivals();
}

std::optional<pipeline::RunContext> Reception::run() {
  while (!interruption_requested() && !closed()) {
    {
      std::unique_lock lock(mutex_);
      work_.wait_for(lock, kPoll, [&] { return is_ordered_ || board_.closed(); });
      is_working_ = std::exchange(is_ordered_, false);
      if (!is_working_) continue;
    }
    std::optional<pipeline::RunContext> context;
    const auto setback = setback_of([&] { context = prepared(); }, "stopped");
    const std::lock_guard lock(mutex_);
    is_working_ = false;
    board_.change([&](StateMessage& state) { end_task(state, setback); });
    if (context) return context;
  }
  return std::nullopt;
}

/// What was prepared by an earlier call is taken, unless somebody sent something or asks again.
pipeline::RunContext Reception::prepared() {
  fs::path source = source_;
  bool is_new = false;
  {
    const std::lock_guard lock(mutex_);
    if (board_.read([](const StateMessage& state) { return state.arrived.files > 0; })) source = arrived_source();
    is_new = std::exchange(is_new_, true);
  }
  const auto between = [this] {
    if (should_stop()) throw Interrupted("stopped");
  };
  BoardObserver observer(board_, observer_, "prepare", between, [this] { return should_stop(); });
  if (source.empty()) throw UsageError("nothing has arrived yet");
  if (!source_.empty() && source != source_) observer.say(note_instead_of(source_));
  fs::path capture = source;
  if (prepare::needs_preparing(source)) {
    capture = run_.parent_path() / (run_.filename().string() + "-capture");
    pipeline::PrepareJob job{source, capture, {}, {.resume = true}};
    // What was prepared of another folder, whose place may have changed, is left to its owner.
    const bool is_ours = fs::exists(capture / "work");
    if (is_new || (is_ours && pipeline::was_begun_for_another(job))) job.existing = {.overwrite = true};
    pipeline::prepare_step(job, cpu_engines(), observer);
  }
  return open_(capture, observer);
}

fs::path Reception::arrived_source() const {
  fs::path folder = arrivals_;
  for (;;) {
    std::vector<fs::path> entries;
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (!is_hidden(entry.path())) entries.push_back(entry.path());
    }
    if (entries.size() != 1) return folder;
    // A folder that was dropped comes as itself; a clip alone is no folder of photographs.
    if (!fs::is_directory(entries.front()))
      return is_one_of(kind_of(entries.front()), kClipKinds) ? entries.front() : folder;
    folder = entries.front();
  }
}

/// Beside a source of the command line, what came in an earlier call waits until something comes in this one.
void Reception::count_arrivals() {
  ArrivedMessage arrived;
  arrived.source = source_.string();
  std::error_code failure;
  for (const auto& entry : fs::recursive_directory_iterator(arrivals_, failure)) {
    const bool is_taken = has_arrived_ || source_.empty();
    if (!is_taken || is_hidden(entry.path()) || !entry.is_regular_file(failure)) continue;
    ++arrived.files;
    arrived.bytes += entry.file_size(failure);
  }
  board_.change([&](StateMessage& state) { state.arrived = arrived; });
}

bool Reception::should_stop() const {
  const std::lock_guard lock(mutex_);
  return stop_requested_ || board_.closed() || interruption_requested();
}

void Reception::close() {
  const std::lock_guard lock(mutex_);
  board_.close();
  work_.notify_all();
}

// ---- answers ------------------------------------------------------------------------------------------------------

std::span<const Route<Reception>> Reception::routes() {
  static const Route<Reception> routes[] = {
      {"GET", "/studio/scene", 0, &Reception::get_scene},
      {"GET", "/studio/state", 0, &Reception::get_state},
      {"GET", "/studio/events", 0, &Reception::get_state},
      {"PUT", "/studio/arrivals", kLargestPiece, &Reception::put_arrival},
      {"POST", "/studio/orders", kSmallBody, &Reception::post_order},
  };
  return routes;
}

PageAnswer Reception::get_scene(const PageRequest& /*request*/) {
  SceneMessage scene;
  scene.run = name_of_run(run_);
  scene.up = "+y";
  return {.body = json_of(scene).dump()};
}

PageAnswer Reception::get_state(const PageRequest& /*request*/) {
  return {.body = board_.text()};
}

PageAnswer Reception::put_arrival(const PageRequest& request) {
  const auto name = request.parameters.find("name"), place = request.parameters.find("offset");
  if (name == request.parameters.end()) throw InputError("arrivals", "name", "is missing");
  const fs::path path = checked_name(name->second);
  const auto offset = place == request.parameters.end() ? std::nullopt : value_in<std::uint64_t>(place->second);
  if (!offset || *offset > kLargestFile || request.body.size() > kLargestFile - *offset) {
    throw InputError(name->second, "offset", fmt::format("expected 0 to {}", kLargestFile));
  }
  const std::lock_guard lock(mutex_);
  if (auto why = board_.become_writer(request.client)) return *why;
  if (is_working_ || is_ordered_) return refusal(409, "wait until it is done: prepare");
  const fs::path file = arrivals_ / path;
  const auto arrived = board_.read([](const StateMessage& state) { return state.arrived; });
  std::error_code failure;
  const auto replaced = fs::file_size(file, failure);
  const bool is_new = bool(failure);
  if (arrived.bytes + request.body.size() > kMostBytes || (is_new && std::size_t(arrived.files) >= kMostFiles)) {
    return refusal(413, fmt::format("at most {} files of {} bytes in all", kMostFiles, kMostBytes));
  }
  const auto begin_anew = [&] { return refusal(409, name->second + ": begins anew at 0"); };
  if (is_new && *offset > 0) return begin_anew();
  check_arrivals(arrivals_);
  if (!is_marked(arrivals_)) {
    write_file(arrivals_ / kArrivalsMark, "The page of cnerf studio sent these files.\n");
    has_arrived_ = false;  // what had is gone
  }
  std::optional<std::uint64_t> size;
  try {
    size = append(file, *offset, request.body);
  } catch (const OutputError&) {
    count_arrivals();
    throw;
  }
  if (!size) return begin_anew();
  is_new_ = true;
  if (!std::exchange(has_arrived_, true)) {
    count_arrivals();
    if (!source_.empty()) board_.note(note_instead_of(source_));
  } else {
    board_.change([&](StateMessage& state) {
      state.arrived.files += is_new ? 1 : 0;
      state.arrived.bytes += request.body.size() - (*offset > 0 || is_new ? 0 : std::uint64_t(replaced));
    });
  }
  return {.body = nlohmann::json{{"bytes", *size}}.dump()};
}

PageAnswer Reception::post_order(const PageRequest& request) {
  const auto order = record_of<OrderMessage>(parse_json(request.body, "order"), "order");
  const std::lock_guard lock(mutex_);
  if (auto why = board_.become_writer(request.client)) return *why;
  if (order.order == "stop") {
    stop_requested_ = true;
  } else if (is_working_ || is_ordered_) {
    return refusal(409, "wait until it is done: prepare");
  } else if (order.order == "clear") {
    check_arrivals(arrivals_);
    remove_output(arrivals_);
    has_arrived_ = false;
    is_new_ = true;
    count_arrivals();
    board_.change([](StateMessage& state) {
      state.message.clear();
      state.failed = false;
      state.notes.clear();
    });
  } else if (order.order == "prepare") {
    is_ordered_ = true;
    stop_requested_ = false;
    board_.change([](StateMessage& state) {
      state.task = "prepare";
      state.message.clear();
      state.failed = false;
      state.notes.clear();
    });
    work_.notify_all();
  } else {
    throw InputError("order", "order",
                     "there is no scene yet to do this with: " + excerpt(nlohmann::ordered_json(order.order)));
  }
  return {.status = 202, .body = board_.text()};
}

}  // namespace cnerf::studio
