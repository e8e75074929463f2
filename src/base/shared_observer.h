#pragma once
/// An observer of a job that works in several threads.

#include <mutex>

#include "src/base/observer.h"

namespace cnerf {

/// Hands on what several threads say, one at a time.
class SharedObserver final : public Observer {
 public:
  /// @param inner  must outlive this
  explicit SharedObserver(Observer& inner) : inner_(inner) {}
  void report_progress(const Progress& progress) override {
    with_lock([&] { inner_.report_progress(progress); });
  }
  void say(const std::string& text) override {
    with_lock([&] { inner_.say(text); });
  }
  void wrote(const std::string& what, const std::filesystem::path& path) override {
    with_lock([&] { inner_.wrote(what, path); });
  }
  void offer_preview(const DrawPreview& draw) override {
    with_lock([&] { inner_.offer_preview(draw); });
  }
  [[nodiscard]] bool wants_previews() const override { return inner_.wants_previews(); }
  [[nodiscard]] bool is_cancelled() const override { return inner_.is_cancelled(); }

 private:
  template <typename Work>
  void with_lock(const Work& work) {
    const std::lock_guard lock(mutex_);
    work();
  }
  Observer& inner_;
  std::mutex mutex_;
};

}  // namespace cnerf
