// exec: colorizers written here, as shell and Python programs: good ones and every way of being bad.

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

#include "src/base/files.h"
#include "src/color/ab_bins.h"
#include "tests/colorizer/questions.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

using test::message_of;
using test::some_question;
using ::testing::AllOf;
using ::testing::HasSubstr;

bool has_python() {
  static const bool is_there = std::system("python3 -c pass >/dev/null 2>&1") == 0;
  return is_there;
}

/// A program that reads every question into B, H, W and the list L, then does `answer_lines`.
std::string program(const std::string& answer_lines) {
  return R"(import array, os, struct, sys, time
source, sink = sys.stdin.buffer, sys.stdout.buffer
def put(kind, shape, values):
    sink.write(struct.pack('<4s5I', b'CNA1', kind, *shape) + array.array('f', values).tobytes())
    sink.flush()
while True:
    head = source.read(20)
    if len(head) < 20:
        break
    magic, version, B, H, W = struct.unpack('<4s4I', head)
    assert (magic, version) == (b'CNQ1', 1)
    L = array.array('f', source.read(4 * B * H * W))
)" + answer_lines;
}

class ExecColorizer : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!has_python()) GTEST_SKIP() << "needs python3";
  }
  /// The command that runs a program whose answer is `answer_lines`.
  std::string command(const std::string& answer_lines) {
    write_file(folder_ / "program.py", program(answer_lines));
    return "exec:python3 " + (folder_ / "program.py").string();
  }
  std::string failure_of(const std::string& answer_lines, double timeout_seconds = 90) {
    const std::string spec = command(answer_lines);
    return message_of<ColorizerError>(
        [&] { (void)test::colorizer_of(spec, timeout_seconds)->colorize(some_question()); });
  }
  test::TempDir folder_;
};

// a = L - 50, b = -L, of each patch.
constexpr const char* kGoodAnswer = R"(
    n = H * W
    out = []
    for i in range(B):
        patch = L[i * n:(i + 1) * n]
        out += [v - 50 for v in patch] + [-v for v in patch]
    put(0, (B, 2, H, W), out)
)";

TEST_F(ExecColorizer, APromptReachesTheProgramAsOneWordWhateverIsInIt) {
  const std::string prompt = R"(it's a "red" $HOME; `fox`)";
  write_file(folder_ / "wanted.txt", prompt);
  ColorizerOptions options;
  options.spec = command(R"(
    same = sys.argv[1] == open(sys.argv[2]).read() and len(sys.argv) == 3
    put(0, (B, 2, H, W), [42.0 if same else -42.0] * (2 * B * H * W))
)") + " {prompt} " +
                 (folder_ / "wanted.txt").string();
  options.prompt = prompt;
  EXPECT_EQ(make_colorizer(options)->colorize(some_question()).ab[0], 42);

  options.prompt = "a {prompt} of a fox";
  options.spec = command(R"(
    same = sys.argv[1:] == ['a {prompt} of a fox'] * 2
    put(0, (B, 2, H, W), [42.0 if same else -42.0] * (2 * B * H * W))
)") + " {prompt} {prompt}";
  EXPECT_EQ(make_colorizer(options)->colorize(some_question()).ab[0], 42) << "each place, and not what stands there";

  options.spec = command(kGoodAnswer);
  EXPECT_THAT(message_of<UsageError>([&] { (void)make_colorizer(options); }), HasSubstr("--prompt"));
}

TEST_F(ExecColorizer, SpeaksTheProtocolForManyQuestions) {
  const auto colorizer = test::colorizer_of(command(kGoodAnswer));
  for (const auto& question : {some_question(2, 6, 5), some_question(1, 3, 9), some_question(4, 128, 128)}) {
    const ChromaBatch answer = colorizer->colorize(question);
    EXPECT_NO_THROW(check_answer("exec", question, answer));
    const std::size_t pixels = std::size_t(question.height * question.width);
    for (int i = 0; i < question.batch; ++i) {
      const std::vector<float> ab = ab_of(answer, i);
      for (std::size_t p = 0; p < pixels; ++p) {
        const float lightness = question.lightness[std::size_t(i) * pixels + p];
        ASSERT_FLOAT_EQ(ab[p], lightness - 50);
        ASSERT_FLOAT_EQ(ab[pixels + p], -lightness);
      }
    }
  }
}

TEST_F(ExecColorizer, MayAnswerEachPatchBeforeItHasReadTheNext) {
  const std::string answers_as_it_reads = R"(import struct, sys
source, sink = sys.stdin.buffer, sys.stdout.buffer
magic, version, B, H, W = struct.unpack('<4s4I', source.read(20))
sink.write(struct.pack('<4s5I', b'CNA1', 0, B, 2, H, W))
for patch in range(B):
    L = source.read(4 * H * W)
    sink.write(L + L)
    sink.flush()
)";
  write_file(folder_ / "program.py", answers_as_it_reads);
  const auto colorizer = test::colorizer_of("exec:python3 " + (folder_ / "program.py").string(), 20);
  const LightnessBatch question = some_question(16, 128, 128);  // 1 MB, 16 times what a pipe holds
  const ChromaBatch answer = colorizer->colorize(question);
  EXPECT_EQ(answer.ab.back(), question.lightness.back());
}

TEST_F(ExecColorizer, MayAnswerDistributions) {
  const auto colorizer =
      test::colorizer_of(command("    put(1, (B, 313, H, W), [float(i % 7) for i in range(B * 313 * H * W)])\n"));
  const ChromaBatch answer = colorizer->colorize(some_question());
  EXPECT_TRUE(answer.has_distribution());
  EXPECT_EQ(answer.logits[8], 1.0f);
}

TEST_F(ExecColorizer, CrashNamesTheCommandAndShowsItsLastWords) {
  EXPECT_THAT(failure_of("    sys.stderr.write('first\\nout of memory, sorry\\n'); sys.exit(3)\n"),
              AllOf(HasSubstr("program.py"), HasSubstr("out of memory, sorry"), HasSubstr("exited with 3")));
  EXPECT_THAT(failure_of("    os.kill(os.getpid(), 11)\n"), HasSubstr("signal 11"));
}

TEST_F(ExecColorizer, AShortAnswerIsAnError) {
  EXPECT_THAT(failure_of("    sink.write(struct.pack('<4s5I', b'CNA1', 0, B, 2, H, W) + b'1234')\n"
                         "    sink.flush(); sys.exit(0)\n"),
              HasSubstr("before it had answered completely"));
}

TEST_F(ExecColorizer, AWrongShapeIsAnError) {
  EXPECT_THAT(failure_of("    put(0, (B, 2, H + 1, W), [0.0] * (B * 2 * (H + 1) * W))\n"),
              AllOf(HasSubstr("program.py"), HasSubstr("[2, 2, 7, 5]"), HasSubstr("[2, 2, 6, 5]")));
  EXPECT_THAT(failure_of("    put(0, (B, 3, H, W), [0.0] * (B * 3 * H * W))\n"), HasSubstr("[2, 3, 6, 5]"));
  EXPECT_THAT(failure_of("    put(7, (B, 2, H, W), [0.0] * (B * 2 * H * W))\n"), HasSubstr("kind 7"));
}

TEST_F(ExecColorizer, AHugeShapeAllocatesNothing) {
  EXPECT_THAT(failure_of("    put(0, (2**31, 2, 2**31, 2**31), [])\n"), HasSubstr("2147483648"));
}

TEST_F(ExecColorizer, ColoursBeyondLabAreAnError) {
  EXPECT_THAT(failure_of("    put(0, (B, 2, H, W), [1e30] * (B * 2 * H * W))\n"),
              AllOf(HasSubstr("program.py"), HasSubstr("-160 to 160"), HasSubstr("1000000")));
}

TEST_F(ExecColorizer, MoreThanAskedForIsAnError) {
  const auto colorizer =
      test::colorizer_of(command("    put(0, (B, 2, H, W), [0.0] * (B * 2 * H * W))\n"
                                 "    sink.write(b'more'); sink.flush()\n"
                                 "    open('" +
                                 (folder_ / "written").string() + "', 'w').close()\n"));
  (void)colorizer->colorize(some_question());
  while (!std::filesystem::exists(folder_ / "written")) std::this_thread::yield();
  EXPECT_THAT(message_of<ColorizerError>([&] { (void)colorizer->colorize(some_question()); }),
              HasSubstr("more than it was asked for"));
}

TEST_F(ExecColorizer, WhatItSaysCannotRuleTheTerminal) {
  EXPECT_THAT(failure_of("    sys.stderr.write('\\x1b[2Jcleared'); sys.exit(3)\n"), HasSubstr("?[2Jcleared"));
}

TEST_F(ExecColorizer, NotANumberIsAnError) {
  EXPECT_THAT(failure_of("    sys.stderr.write('diverged\\n'); sys.stderr.flush()\n"
                         "    put(0, (B, 2, H, W), [float('nan')] * (B * 2 * H * W))\n"),
              AllOf(HasSubstr("program.py"), HasSubstr("nan"), HasSubstr("diverged")));
}

TEST_F(ExecColorizer, PrintingToStandardOutputIsExplained) {
  EXPECT_THAT(failure_of("    print('loading the model, please wait ...', flush=True); time.sleep(5)\n"),
              HasSubstr("standard output"));
}

TEST_F(ExecColorizer, AHangIsKilledWithItsWholeProcessGroup) {
  const auto pid_file = folder_ / "pid";
  const auto start = std::chrono::steady_clock::now();
  // A grandchild of the shell sleeps; its number is written down.
  const std::string spec = "exec:(sleep 300 & echo $! > " + pid_file.string() + "; wait)";
  const std::string message =
      message_of<ColorizerError>([&] { (void)test::colorizer_of(spec, 0.3)->colorize(some_question()); });
  EXPECT_THAT(message, AllOf(HasSubstr("sleep 300"), HasSubstr("0.3 s")));
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(15));
  const int grandchild = std::stoi(read_text_file(pid_file));
  // Killed, it may still wait for init to collect it.
  const auto is_gone = [&] {
    std::ifstream stat("/proc/" + std::to_string(grandchild) + "/stat");
    std::string line;
    return !std::getline(stat, line) || line.find(") Z ") != std::string::npos;
  };
  bool gone = false;
  for (int i = 0; i < 200 && !gone; ++i) {
    gone = is_gone();
    if (!gone) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_TRUE(gone);
}

TEST_F(ExecColorizer, ACrashIsForgivenOnce) {
  const std::string flag = (folder_ / "crashed").string();
  const auto colorizer = test::colorizer_of(command("    if not os.path.exists('" + flag + "'):\n        open('" +
                                                    flag + "', 'w').close(); sys.exit(1)\n" + kGoodAnswer));
  const LightnessBatch question = some_question();
  EXPECT_NO_THROW(check_answer("exec", question, colorizer->colorize(question)));
  EXPECT_TRUE(std::filesystem::exists(flag)) << "the program never crashed: the test shows nothing";
}

TEST_F(ExecColorizer, AProgramThatStopsReadingRaisesNoSignal) {
  // 16 MB do not fit into a pipe: writing goes on after the reader is gone.
  const std::string message = message_of<ColorizerError>(
      [] { (void)test::colorizer_of("exec:exit 9")->colorize(some_question(4, 1000, 1000)); });
  EXPECT_THAT(message, HasSubstr("exited with 9"));
  struct sigaction now {};
  sigaction(SIGPIPE, nullptr, &now);
  EXPECT_EQ(now.sa_handler, SIG_DFL);
}

TEST_F(ExecColorizer, AMissingProgramIsNamed) {
  const std::string message = message_of<ColorizerError>(
      [] { (void)test::colorizer_of("exec:no-such-program-here")->colorize(some_question()); });
  EXPECT_THAT(message, AllOf(HasSubstr("no-such-program-here"), HasSubstr("not found"), HasSubstr("127")));
}

TEST_F(ExecColorizer, MuchTalkOnStandardErrorDoesNotBlock) {
  const auto colorizer = test::colorizer_of(
      command("    sys.stderr.write('.' * 300000); sys.stderr.flush()\n" + std::string(kGoodAnswer)));
  ::testing::internal::CaptureStderr();
  const ChromaBatch answer = colorizer->colorize(some_question());
  const std::string passed_through = ::testing::internal::GetCapturedStderr();
  EXPECT_EQ(answer.ab.size(), 2u * 2 * 6 * 5);
  EXPECT_GE(passed_through.size(), 300000u);
}

}  // namespace
}  // namespace cnerf
