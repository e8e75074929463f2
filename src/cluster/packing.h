#pragma once
/// Values one after another as bytes, for processes of the same program.

#include <cstddef>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "src/base/check.h"
#include "src/cluster/channel.h"

namespace cnerf::cluster {

class Packer {
 public:
  template <typename Value>
  requires std::is_trivially_copyable_v<Value> Packer& add(const Value& value) {
    return add_bytes(std::as_bytes(std::span(&value, 1)));
  }
  template <typename Value>
  Packer& add(const std::vector<Value>& values) {
    static_assert(std::is_trivially_copyable_v<Value>);
    return add(values.size()).add_bytes(std::as_bytes(std::span(values)));
  }
  Packer& add(const std::string& text) { return add(text.size()).add_bytes(std::as_bytes(std::span(text))); }
  [[nodiscard]] Bytes packed() { return std::move(bytes_); }

 private:
  Packer& add_bytes(std::span<const std::byte> bytes) {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    return *this;
  }
  Bytes bytes_;
};

/// In the order of packing. The bytes must outlive this.
class Unpacker {
 public:
  explicit Unpacker(std::span<const std::byte> bytes) : rest_(bytes) {}
  template <typename Value>
  requires std::is_trivially_copyable_v<Value> Unpacker& get(Value& value) { return get_bytes(&value, sizeof value); }
  template <typename Value>
  Unpacker& get(std::vector<Value>& values) {
    static_assert(std::is_trivially_copyable_v<Value>);
    values.resize(size(sizeof(Value)));
    return get_bytes(values.data(), values.size() * sizeof(Value));
  }
  Unpacker& get(std::string& text) {
    text.resize(size());
    return get_bytes(text.data(), text.size());
  }

 private:
  std::size_t size(std::size_t of_each = 1) {
    std::size_t size = 0;
    get(size);
    CNERF_CHECK(size <= rest_.size() / of_each, "packed by the same program");
    return size;
  }
  Unpacker& get_bytes(void* to, std::size_t size) {
    CNERF_CHECK(size <= rest_.size(), "packed by the same program");
    if (size > 0) std::memcpy(to, rest_.data(), size);
    rest_ = rest_.subspan(size);
    return *this;
  }
  std::span<const std::byte> rest_;
};

}  // namespace cnerf::cluster
