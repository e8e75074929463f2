#pragma once
/// Finished parts of a bake on disk, so that a bake holds little in memory and goes on where it was stopped.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>
#include <filesystem>
#include <functional>
#include <future>
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
/// parts, also while one is written. Checksums find accidents and another bake's parts; against who forges a file,
/// parts are checked before they are used.
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
  /// called by several threads, and `use` by one, while the next parts are made.
  /// @param is_sound  asked of each part that was read, before it is used: whether this bake can have made it; no
  ///                  answer needed where none is given
  /// @throws JournalError  when a part was not sound.
  /// @throws OutputError  when one cannot be written, e.g. on a full disk; and whatever `make` and `use` throw.
  template <typename T>
  void parts(std::size_t first, std::size_t count, std::size_t at_a_time,
             const std::function<std::vector<T>(std::size_t)>& make,
             const std::function<void(std::size_t, const std::vector<T>&)>& use,
             const std::function<bool(std::size_t, const std::vector<T>&)>& is_sound = {}) {
    at_a_time *= std::size_t(ranks_->size());
    std::future<void> keeping;  // of the parts before, while others are made
    for (std::size_t begin = 0; begin < count; begin += at_a_time) {
      auto some = made<T>({first, begin, std::min(at_a_time, count - begin)}, make, is_sound);
      if (std::exception_ptr before = failure_of(keeping)) some.failure = std::move(before);
      const bool waits = some.failure || !ranks_->is_alone();
      keeping = std::async(waits ? std::launch::deferred : std::launch::async,
                           [this, &use, some = std::move(some)]() mutable { keep(std::move(some), use); });
      if (waits) keeping.get();
    }
    if (keeping.valid()) keeping.get();
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
  struct Range {
    std::size_t first, begin, count;  ///< the number of part 0, and which of those behind it
  };
  template <typename T>
  struct Batch {
    Range range;
    std::vector<std::optional<std::vector<T>>> parts;
    std::exception_ptr failure;  ///< why some are not there
  };

  template <typename T>
  [[nodiscard]] Batch<T> made(const Range& range, const std::function<std::vector<T>(std::size_t)>& make,
                              const std::function<bool(std::size_t, const std::vector<T>&)>& is_sound) const {
    const auto ranks = std::size_t(ranks_->size()), rank = std::size_t(ranks_->rank());
    Batch<T> batch{range, std::vector<std::optional<std::vector<T>>>(range.count), nullptr};
    const std::size_t begin = range.begin, first = range.first + begin, finished = finished_of_rank_0();
    try {
      parallel_tasks(batch.parts.size(), [&](std::size_t i) {
        if (first + i >= finished) {
          if (i % ranks == rank) batch.parts[i] = make(begin + i);
          return;
        }
        if (rank > 0) return;
        std::vector<T> part = read<T>(first + i);
        if (is_sound && !is_sound(begin + i, part)) refuse(first + i);
        batch.parts[i] = std::move(part);
      });
    } catch (...) {
      batch.failure = std::current_exception();
    }
    if (ranks > 1) hear_of_refusals(batch.failure);
    if (ranks > 1 && !batch.failure) exchange(finished - std::min(finished, first), batch.parts);
    return batch;
  }
  /// Waits.
  [[nodiscard]] static std::exception_ptr failure_of(std::future<void>& work);
  /// What is made is kept, whoever stops the bake.
  template <typename T>
  void keep(Batch<T> batch, const std::function<void(std::size_t, const std::vector<T>&)>& use) {
    const std::size_t begin = batch.range.begin, first = batch.range.first + begin;
    for (std::size_t i = 0; i < batch.parts.size() && batch.parts[i]; ++i) {
      if (first + i < size()) continue;
      if (batch.failure && first + i > size()) break;  // it was those before that could not be kept
      append(first + i, std::as_bytes(std::span<const T>(*batch.parts[i])));
    }
    if (batch.failure) std::rethrow_exception(batch.failure);
    for (std::size_t i = 0; i < batch.parts.size(); ++i) {
      use(begin + i, *batch.parts[i]);
      batch.parts[i].reset();
    }
  }
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
