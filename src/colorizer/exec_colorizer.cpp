// exec:COMMAND, any program over pipes; docs/colorizers.md describes the protocol.

#include <array>
#include <bit>
#include <cstdio>
#include <cstring>
#include <optional>

#include "src/base/error.h"
#include "src/base/process.h"
#include "src/color/ab_bins.h"
#include "src/colorizer/kinds.h"

namespace cnerf {
namespace {

static_assert(std::endian::native == std::endian::little, "the protocol is little-endian");

constexpr std::array<char, 4> kQuestionMagic{'C', 'N', 'Q', '1'}, kAnswerMagic{'C', 'N', 'A', '1'};
constexpr std::uint32_t kVersion = 1, kAbKind = 0, kLogitsKind = 1;
constexpr std::string_view kPromptPlace = "{prompt}";
constexpr int kAttempts = 2;  // a program that crashed or hung is started once more

struct QuestionHeader {
  std::array<char, 4> magic;
  std::uint32_t version, batch, height, width;
};
struct AnswerHeader {
  std::array<char, 4> magic;
  std::uint32_t kind, batch, channels, height, width;
};
static_assert(sizeof(QuestionHeader) == 20 && sizeof(AnswerHeader) == 24);

class ExecColorizer final : public Colorizer {
 public:
  ExecColorizer(std::string command, double timeout_seconds)
      : command_(std::move(command)), timeout_seconds_(timeout_seconds) {
    child_.emplace(command_);
  }

  ChromaBatch colorize(const LightnessBatch& patches) override {
    for (int attempt = 1;; ++attempt) {
      if (!child_) child_.emplace(command_);
      ChromaBatch answer;
      const PipeTrouble trouble = ask(patches, answer);
      if (trouble == PipeTrouble::kNone) {
        check_or_stop(patches, answer);
        return answer;
      }
      const std::string problem = describe(trouble);
      child_.reset();
      if (attempt == kAttempts) throw ColorizerError(problem);
    }
  }

  [[nodiscard]] std::string name() const override { return "exec:" + command_; }

 private:
  PipeTrouble ask(const LightnessBatch& patches, ChromaBatch& answer) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::duration_cast<std::chrono::milliseconds>(
                                                                 std::chrono::duration<double>(timeout_seconds_));
    const QuestionHeader question{kQuestionMagic, kVersion, std::uint32_t(patches.batch), std::uint32_t(patches.height),
                                  std::uint32_t(patches.width)};
    if (child_->has_unread_output()) stop("wrote more than it was asked for; does it print to standard output?");
    PipeTrouble trouble = child_->write_all(std::as_bytes(std::span(&question, 1)), deadline);
    if (trouble != PipeTrouble::kNone) return trouble;
    trouble = child_->write_all(std::as_bytes(std::span(patches.lightness)), deadline);
    if (trouble != PipeTrouble::kNone) return trouble;

    AnswerHeader header{};
    trouble = child_->read_all(std::as_writable_bytes(std::span(&header, 1)), deadline);
    if (trouble != PipeTrouble::kNone) return trouble;
    check_header(patches, header);
    answer = {patches.batch, patches.height, patches.width, {}, {}};
    std::vector<float>& values = header.kind == kLogitsKind ? answer.logits : answer.ab;
    values.resize(patches.lightness.size() * header.channels);
    return child_->read_all(std::as_writable_bytes(std::span(values)), deadline);
  }

  /// The size is known before a byte of data is read: a wrong header must not become a huge allocation.
  void check_header(const LightnessBatch& patches, const AnswerHeader& header) {
    if (header.magic != kAnswerMagic) {
      stop("answered something else than the protocol's CNA1 header; does it print to standard output?");
    }
    if (header.kind != kAbKind && header.kind != kLogitsKind) {
      stop("answered kind " + std::to_string(header.kind) + "; expected 0 (ab) or 1 (logits)");
    }
    const std::uint32_t channels = header.kind == kAbKind ? 2 : std::uint32_t(kAbBinCount);
    const QuestionHeader asked{kQuestionMagic, kVersion, std::uint32_t(patches.batch), std::uint32_t(patches.height),
                               std::uint32_t(patches.width)};
    if (header.batch != asked.batch || header.channels != channels || header.height != asked.height ||
        header.width != asked.width) {
      const auto shape = [](std::uint32_t b, std::uint32_t c, std::uint32_t h, std::uint32_t w) {
        return "[" + std::to_string(b) + ", " + std::to_string(c) + ", " + std::to_string(h) + ", " +
               std::to_string(w) + "]";
      };
      stop("answered shape " + shape(header.batch, header.channels, header.height, header.width) + "; expected " +
           shape(asked.batch, channels, asked.height, asked.width));
    }
  }

  void check_or_stop(const LightnessBatch& patches, const ChromaBatch& answer) {
    try {
      check_answer(name(), patches, answer);
    } catch (const ColorizerError& error) {
      const std::string words = child_->last_words();
      child_.reset();
      throw ColorizerError(error.what() + words);
    }
  }

  /// A program that breaks the protocol is not asked again.
  [[noreturn]] void stop(const std::string& problem) {
    const std::string words = child_->last_words();
    child_->process().kill_group();
    child_.reset();
    throw ColorizerError(name() + ": " + problem + words);
  }

  std::string describe(PipeTrouble trouble) {
    std::string problem;
    if (trouble == PipeTrouble::kTimedOut) {
      std::array<char, 32> seconds{};
      std::snprintf(seconds.data(), seconds.size(), "%g", timeout_seconds_);
      problem = std::string("gave no complete answer within ") + seconds.data() + " s and was killed";
      child_->process().kill_group();
    } else {
      const std::string fate = child_->process().fate();
      problem = "ended before it had answered completely: it " + fate;
      child_->process().kill_group();
    }
    return name() + ": " + problem + child_->last_words();
  }

  std::string command_;
  double timeout_seconds_;
  std::optional<PipedProcess> child_;
};

}  // namespace

bool takes_prompt(const std::string& command) {
  return command.find(kPromptPlace) != std::string::npos;
}

std::unique_ptr<Colorizer> make_exec_colorizer(const ColorizerRequest& request) {
  std::string command = request.argument;
  const std::string prompt = shell_word(request.options.prompt);
  for (auto place = command.find(kPromptPlace); place != std::string::npos;
       place = command.find(kPromptPlace, place + prompt.size())) {
    command.replace(place, kPromptPlace.size(), prompt);
  }
  return std::make_unique<ExecColorizer>(command, request.options.timeout_seconds);
}

}  // namespace cnerf
