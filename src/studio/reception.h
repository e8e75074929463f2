#pragma once
/// Where a studio begins without a scene: photographs, a clip or a whole capture arrive from the page, and are
/// prepared.

#include <condition_variable>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <span>
#include <string>

#include "src/base/observer.h"
#include "src/pipeline/run_context.h"
#include "src/studio/board_api.h"

namespace cnerf::studio {

/// Bytes of a piece of a file that a page sends.
inline constexpr std::size_t kLargestPiece = std::size_t(8) << 20;

/// GET  scene, state, events
/// PUT  arrivals?name=PATH&offset=BYTES   a piece of a file; 0 begins it anew
/// POST orders                            prepare, clear, stop
class Reception final : public BoardApi<Reception> {
 public:
  /// Begins a run on what was prepared.  @throws Error  it cannot be begun with this capture
  using Open = std::function<pipeline::RunContext(const std::filesystem::path& capture, Observer& observer)>;

  /// @param source  photographs, a clip or a capture to begin with at once; what the page sends takes its place.
  ///                Empty = wait for the page
  /// @param run     folder that the run will go to; what arrives is kept beside it
  /// @param observer  hears what is done; referred to
  /// @throws UsageError  the folder for what arrives holds files of somebody else
  Reception(std::filesystem::path source, const std::filesystem::path& run, Open open, Observer& observer);

  /// Waits for a capture and begins the run.  @return  nothing when the user ended the program, or it was closed
  [[nodiscard]] std::optional<pipeline::RunContext> run();

  void close() override;

 private:
  friend class BoardApi<Reception>;  // asks for the routes
  static std::span<const Route<Reception>> routes();
  web::PageAnswer get_scene(const web::PageRequest& request);
  web::PageAnswer get_state(const web::PageRequest& request);
  web::PageAnswer put_arrival(const web::PageRequest& request);
  web::PageAnswer post_order(const web::PageRequest& request);

  [[nodiscard]] pipeline::RunContext prepared();
  /// What has arrived, as `prepare` wants it: a folder, or the one clip.
  [[nodiscard]] std::filesystem::path arrived_source() const;
  /// Counts what `prepare` would take.
  void count_arrivals();
  [[nodiscard]] bool should_stop() const;

  std::filesystem::path source_, run_, arrivals_;
  Open open_;
  Observer& observer_;

  mutable std::mutex mutex_;  // of what follows; taken before the board's
  std::condition_variable work_;
  bool is_ordered_ = false, is_working_ = false, stop_requested_ = false;
  bool has_arrived_ = false;  // something, from the page, in this call
  bool is_new_ = false;       // what was prepared by an earlier call is not what is wanted
};

}  // namespace cnerf::studio
