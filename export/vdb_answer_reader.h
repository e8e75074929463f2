#pragma once
/// What the program that reads VDB files answers, wherever its bytes come from: vdb_answer.h says how.

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <utility>

#include "bake/volume.h"
#include "export/vdb_reader.h"

namespace cnerf::exporting {

/// The bytes of an answer.
class VdbAnswerSource {
 public:
  /// @param file  that was asked about
  explicit VdbAnswerSource(std::filesystem::path file) : file_(std::move(file)) {}
  virtual ~VdbAnswerSource() = default;
  VdbAnswerSource(const VdbAnswerSource&) = delete;
  VdbAnswerSource& operator=(const VdbAnswerSource&) = delete;

  /// The next bytes, all of them.  @throws InputError  where there are no more.
  virtual void read(std::span<std::byte> bytes) = 0;
  /// @param what  the program did  @throws InputError
  [[noreturn]] void fail(const std::string& what) const;
  [[nodiscard]] const std::filesystem::path& file() const { return file_; }

 private:
  std::filesystem::path file_;
};

/// Both: @throws MissingInputError, InputError  what the answer says, or what is wrong with it.
[[nodiscard]] bake::Volume volume_of_answer(VdbAnswerSource& source);
[[nodiscard]] VdbSummary summary_of_answer(VdbAnswerSource& source);

}  // namespace cnerf::exporting
