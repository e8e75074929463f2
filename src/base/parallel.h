#pragma once
/// Parallel loops over a fixed partition. Tasks are numbered, and what a task computes depends on its number alone: as
/// long as tasks write to disjoint memory, results do not depend on the number of threads.

#include <cstddef>
#include <functional>

namespace cnerf {

/// Sets how many threads parallel loops use; 0 restores "all cores". Takes effect for loops that start afterwards.
void set_thread_count(int threads);
[[nodiscard]] int thread_count();

/// Calls `task(i)` once for each i in [0, tasks), in any order, on any thread. If tasks throw, the exception of the
/// lowest-numbered one is rethrown here; tasks of higher numbers may then be skipped.
void parallel_tasks(std::size_t tasks, const std::function<void(std::size_t)>& task);

/// Calls `body(begin, end)` over consecutive pieces of [0, count) of at most `grain` elements each.
void parallel_ranges(std::size_t count, std::size_t grain, const std::function<void(std::size_t, std::size_t)>& body);

/// Calls `body(i)` for each i in [0, count), in such pieces.
template <typename Body>
void parallel_each(std::size_t count, std::size_t grain, const Body& body) {
  parallel_ranges(count, grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) body(i);
  });
}

}  // namespace cnerf
