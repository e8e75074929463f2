#pragma once
/// Ending long work from within the program.

namespace cnerf {

/// As Ctrl-C: `interruption_requested` of progress.h is true from now on, and long work saves and stops.
void request_interruption();

}  // namespace cnerf
