#pragma once
/// What tests have to know about sanitizers.

namespace cnerf::test {

/// Whether this build, and so the program beside it, is one of the address or the thread sanitizer. Both need more
/// memory than limits leave them, and end a process that has none where others throw.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kIsSanitized = true;
#else
inline constexpr bool kIsSanitized = false;
#endif

}  // namespace cnerf::test
