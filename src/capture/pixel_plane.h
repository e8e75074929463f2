#pragma once
/// The values of an image's pixels: in memory of their own, or in a file that the system reads as it is needed.

#include <algorithm>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "src/base/check.h"

namespace cnerf {

/// Like a std::vector. Values that lie in a file are for reading only; copies share them.
template <typename T>
class PixelPlane {
 public:
  using value_type = T;
  using iterator = T*;
  using const_iterator = const T*;

  PixelPlane() = default;
  PixelPlane(std::vector<T> values) : own_(std::move(values)) { refer_to_own(); }  // NOLINT: it is what it holds
  /// @param owner  keeps the values where they are
  PixelPlane(std::shared_ptr<const void> owner, const T* values, std::size_t size)
      : owner_(std::move(owner)), values_(const_cast<T*>(values)), size_(size) {}
  PixelPlane(const PixelPlane& other) : own_(other.own_), owner_(other.owner_) { refer_as(other); }
  PixelPlane(PixelPlane&& other) noexcept { *this = std::move(other); }
  PixelPlane& operator=(const PixelPlane& other) { return *this = PixelPlane(other); }  // NOLINT: its own copy too
  PixelPlane& operator=(PixelPlane&& other) noexcept {
    own_ = std::move(other.own_);
    owner_ = std::move(other.owner_);
    refer_as(other);
    other.own_.clear();
    other.owner_.reset();
    other.refer_to_own();
    return *this;
  }
  ~PixelPlane() = default;

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] bool empty() const { return size_ == 0; }
  [[nodiscard]] bool is_in_file() const { return owner_ != nullptr; }
  [[nodiscard]] const T* data() const { return values_; }
  [[nodiscard]] const T* begin() const { return values_; }
  [[nodiscard]] const T* end() const { return values_ + size_; }
  [[nodiscard]] const T& operator[](std::size_t i) const { return values_[i]; }

  // For values in memory.
  [[nodiscard]] T* data() { return writable(); }
  [[nodiscard]] T* begin() { return writable(); }
  [[nodiscard]] T* end() { return writable() + size_; }
  [[nodiscard]] T& operator[](std::size_t i) { return writable()[i]; }
  [[nodiscard]] T& back() { return writable()[size_ - 1]; }
  void push_back(T value) {
    (void)writable();
    own_.push_back(value);
    refer_to_own();
  }

  // These forget a file.
  void assign(std::size_t size, T value) { *this = PixelPlane(std::vector<T>(size, value)); }
  void resize(std::size_t size) {
    bring_to_memory();
    own_.resize(size);
    refer_to_own();
  }
  void clear() { *this = PixelPlane(); }
  void bring_to_memory() {
    if (is_in_file()) *this = PixelPlane(std::vector<T>(values_, values_ + size_));
  }

  friend bool operator==(const PixelPlane& a, const PixelPlane& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end());
  }

 private:
  [[nodiscard]] T* writable() {
    CNERF_CHECK(!is_in_file(), "pixels in a file are not written to");
    return values_;
  }
  void refer_to_own() {
    values_ = own_.data();
    size_ = own_.size();
  }
  void refer_as(const PixelPlane& other) {
    refer_to_own();
    if (!is_in_file()) return;
    values_ = other.values_;
    size_ = other.size_;
  }

  std::vector<T> own_;
  std::shared_ptr<const void> owner_;
  T* values_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace cnerf
