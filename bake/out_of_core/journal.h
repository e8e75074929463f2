#pragma once
/// Finished parts of a bake on disk, so that a bake holds little in memory and goes on where it was stopped.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/cluster/packing.h"
#include "src/cluster/ranks.h"

namespace cnerf::bake {

/// A journal that holds what no bake of ours wrote: damaged, forged, or changed by somebody meanwhile.
struct JournalError : InputError {
  using InputError::InputError;
};

/// A list of byte strings in a file that only grows. A process may be killed at any time: what is cut off or damaged is
/// dropped when the file is opened again, and everything before it is still there. Several threads may read finished
/// parts while none is written. Checksums find accidents and another bake's parts; against who forges a file, parts are
/// checked before they are used.
class Journal {
 public:
  /// In a file without a name, gone with the object.  @throws OutputError.
  Journal();
  /// Continues `file` if it was begun under the same `identity`, else begins it anew.
  /// @param identity  says all that the parts depend on; any text.  @throws OutputError.
  Journal(const std::filesystem::path& file, const std::string& identity);
  ~Journal();
  Journal(Journal&&) noexcept;
  Journal& operator=(Journal&&) noexcept;

  /// From now on these ranks make parts for each other. All have a journal of their own, which come to hold the same;
  /// what was found is rank 0's. All call `parts` in the same order, and `restart`.
  void share_with(cluster::Ranks& ranks) { ranks_ = &ranks; }

  [[nodiscard]] std::size_t size() const;
  /// Forgets all parts, those of the file too.  @throws OutputError.
  void restart();
  /// How many parts there were when the file was opened.
  [[nodiscard]] std::size_t found() const;
  [[nodiscard]] bool has_found_any() const { return ranks_->agreed(found() > 0); }

  /// Calls `use(i, part first + i)` for each i below `count`, in order. A part is read if it is finished, else made and
  /// written, which has to happen in order and without gaps. `at_a_time` parts are made at the same time: `make(i)` is
  /// called by several threads.
  /// @param is_sound  asked of each part that was read, before it is used: whether this bake can have made it; no
  ///                  answer needed where none is given
  /// @throws JournalError  when a part was not sound.
  /// @throws OutputError  when one cannot be written, e.g. on a full disk; and whatever `make` and `use` throw.
  template <typename T>
  void parts(std::size_t first, std::size_t count, std::size_t at_a_time,
             const std::function<std::vector<T>(std::size_t)>& make,
             const std::function<void(std::size_t, const std::vector<T>&)>& use,
             const std::function<bool(std::size_t, const std::vector<T>&)>& is_sound = {}) {
    const auto ranks = std::size_t(ranks_->size()), rank = std::size_t(ranks_->rank());
    at_a_time *= ranks;
    for (std::size_t begin = 0; begin < count; begin += at_a_time) {
      std::vector<std::optional<std::vector<T>>> some(std::min(at_a_time, count - begin));
      const std::size_t own = size(), finished = finished_of_rank_0();
      std::exception_ptr failure;
      try {
        parallel_tasks(some.size(), [&](std::size_t i) {
          const std::size_t number = first + begin + i;
          if (number >= finished) {
            if (i % ranks == rank) some[i] = make(begin + i);
            return;
          }
          if (rank > 0) return;
          std::vector<T> part = read<T>(number);
          if (is_sound && !is_sound(begin + i, part)) refuse(number);
          some[i] = std::move(part);
        });
      } catch (...) {
        failure = std::current_exception();
      }
      if (ranks > 1) hear_of_refusals(failure);
      if (ranks > 1 && !failure) exchange(finished - std::min(finished, first + begin), some);
      // What is made is kept, whoever stops the bake.
      for (std::size_t i = 0; i < some.size() && some[i]; ++i) {
        const std::size_t number = first + begin + i;
        if (number >= own) append(number, std::as_bytes(std::span<const T>(*some[i])));
      }
      if (failure) std::rethrow_exception(failure);
      for (std::size_t i = 0; i < some.size(); ++i) {
        use(begin + i, *some[i]);
        some[i].reset();
      }
    }
  }
  /// A finished part.  @throws JournalError  when it cannot be read any more, or is no list of T.
  template <typename T>
  [[nodiscard]] std::vector<T> read(std::size_t number) const {
    static_assert(std::is_trivially_copyable_v<T>, "parts are stored as they lie in memory");
    const std::vector<std::byte> bytes = read_bytes(number);
    if (bytes.size() % sizeof(T) != 0) refuse(number);
    std::vector<T> values(bytes.size() / sizeof(T));
    if (!values.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
    return values;
  }

 private:
  struct File;
  [[nodiscard]] std::size_t finished_of_rank_0() const;
  /// Parts that are not sound are found by rank 0, which reads them; all refuse them.
  void hear_of_refusals(std::exception_ptr& failure) const;
  /// Parts go to all: the first ones from rank 0, which had them, of the others each from who made it.
  template <typename T>
  void exchange(std::size_t had, std::vector<std::optional<std::vector<T>>>& some) const {
    const auto ranks = std::size_t(ranks_->size());
    cluster::Packer packer;
    for (std::size_t i = 0; i < some.size(); ++i) {
      if (some[i]) packer.add(*some[i]);
    }
    const std::vector<cluster::Bytes> all = ranks_->gather(packer.packed());
    std::vector<cluster::Unpacker> of_rank(all.begin(), all.end());
    for (std::size_t i = 0; i < some.size(); ++i) of_rank[i < had ? 0 : i % ranks].get(some[i].emplace());
  }
  void append(std::size_t number, std::span<const std::byte> bytes);
  [[nodiscard]] std::vector<std::byte> read_bytes(std::size_t number) const;
  [[noreturn]] void refuse(std::size_t number) const;

  std::unique_ptr<File> file_;
  cluster::Ranks* ranks_ = &cluster::alone();
};

}  // namespace cnerf::bake
