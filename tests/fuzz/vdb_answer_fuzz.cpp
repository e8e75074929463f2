/// What the program that reads VDB files answers, as its parent reads it.

#include <algorithm>
#include <cstddef>
#include <span>

#include "export/vdb_answer.h"
#include "export/vdb_answer_reader.h"
#include "tests/fuzz/fuzz_target.h"

namespace {

class Answer final : public cnerf::exporting::VdbAnswerSource {
 public:
  explicit Answer(cnerf::fuzz::Bytes rest) : VdbAnswerSource("/bake/volume.vdb"), rest_(rest) {}
  void read(std::span<std::byte> bytes) override {
    if (bytes.size() > rest_.size()) fail("exited with 1");
    std::copy_n(rest_.begin(), bytes.size(), bytes.begin());
    rest_ = rest_.subspan(bytes.size());
  }

 private:
  cnerf::fuzz::Bytes rest_;
};

/// Whether it is an error in the words of the program, which may say anything.
bool is_error(cnerf::fuzz::Bytes answer) {
  cnerf::exporting::VdbAnswerHeader header;
  std::ranges::copy(answer.first(std::min(answer.size(), sizeof header)),
                    std::as_writable_bytes(std::span(&header, 1)).begin());
  return header.status != 0;
}

}  // namespace

CNERF_FUZZ_TARGET(vdb_answer) {
  using namespace cnerf;
  const bool is_volume = fuzz::take_byte(input) % 2 == 0;
  Answer answer(input);
  try {
    if (is_volume) {
      (void)exporting::volume_of_answer(answer);
    } else {
      (void)exporting::summary_of_answer(answer);
    }
  } catch (const Error& refusal) {
    if (!is_error(input)) fuzz::check_refusal(refusal, answer.file());
  }
}
